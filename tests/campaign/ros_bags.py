"""Bags of ROS 1 and ROS 2 for the tests, written by the writers of rosbags, with messages of many types."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("sqlite3", "mcap", "mcap file", "ros1", "mcap zstd", "sqlite3 zstd messages", "sqlite3 zstd file", "ros1 bz2")
BEGAN_NS = 1_700_000_000_123_456_789

_ACKERMANN = """\
std_msgs/Header header
ackermann_msgs/AckermannDrive drive
================================================================================
MSG: ackermann_msgs/AckermannDrive
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
"""
_CUSTOM = """\
uint8 MODE_AUTO=1
string COMMENT="quoted ' \\ text"
my_msgs/Wheel[2] wheels
geometry_msgs/Pose[] bodies
================================================================================
MSG: my_msgs/Wheel
float32 speed
"""


class Sent(NamedTuple):
    """A message as it is written: when it is recorded, its topic, and what makes it."""

    ns: int
    topic: str
    make: Callable[[Make], Any]


class Make:
    """Makes messages of one store of types."""

    def __init__(self, *, is_ros1: bool) -> None:
        self.is_ros1 = is_ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
        self.store.register(get_types_from_msg(_ACKERMANN, "ackermann_msgs/msg/AckermannDriveStamped"))
        self.store.register(get_types_from_msg(_CUSTOM, "my_msgs/msg/Custom"))
        self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))

    def __call__(self, kind: str, *fields: Any) -> Any:
        package, _, name = kind.partition("/")
        return self.store.types[f"{package}/msg/{name}"](*fields)

    def header(self, ns: int, frame: str = "map") -> Any:
        stamp = self("builtin_interfaces/Time", ns // 10**9, ns % 10**9)
        return self("std_msgs/Header", *([0] if self.is_ros1 else []), stamp, frame)

    def quaternion(self, heading: float) -> Any:
        return self("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))

    def pose(self, x: float, y: float, heading: float) -> Any:
        return self("geometry_msgs/Pose", self("geometry_msgs/Point", x, y, 0.3), self.quaternion(heading))

    def pose_stamped(self, ns: int, *pose: float) -> Any:
        return self("geometry_msgs/PoseStamped", self.header(ns), self.pose(*pose))

    def pose_with_covariance(self, ns: int, *pose: float) -> Any:
        content = self("geometry_msgs/PoseWithCovariance", self.pose(*pose), np.zeros(36))
        return self("geometry_msgs/PoseWithCovarianceStamped", self.header(ns), content)

    def odometry(self, ns: int, *pose: float) -> Any:
        content = self("geometry_msgs/PoseWithCovariance", self.pose(*pose), np.zeros(36))
        twist = self("geometry_msgs/TwistWithCovariance", self.twist(9.0, 9.0), np.zeros(36))
        return self("nav_msgs/Odometry", self.header(ns), "base_link", content, twist)

    def transform(self, ns: int, *pose: float, child: str = "base_link") -> Any:
        x, y, heading = pose
        content = self("geometry_msgs/Transform", self.vector(x, y, 0.3), self.quaternion(heading))
        return self("geometry_msgs/TransformStamped", self.header(ns), child, content)

    def tf(self, ns: int, *pose: float) -> Any:
        other = self.transform(ns, 7.0, 7.0, 1.0, child="laser")
        return self("tf2_msgs/TFMessage", [other, self.transform(ns, *pose)])

    def vector(self, *numbers: float) -> Any:
        return self("geometry_msgs/Vector3", *numbers)

    def twist(self, v: float, w: float) -> Any:
        return self("geometry_msgs/Twist", self.vector(v, 0.0, 0.0), self.vector(0.0, 0.0, w))

    def twist_stamped(self, ns: int, v: float, w: float) -> Any:
        return self("geometry_msgs/TwistStamped", self.header(ns), self.twist(v, w))

    def ackermann(self, ns: int, speed: float, angle: float) -> Any:
        drive = self("ackermann_msgs/AckermannDrive", angle, 0.0, speed, 0.0, 0.0)
        return self("ackermann_msgs/AckermannDriveStamped", self.header(ns), drive)

    def number(self, value: float) -> Any:
        return self("std_msgs/Float64", value)

    def custom(self, left: float, right: float, *pose: float) -> Any:
        wheels = [self("my_msgs/Wheel", left), self("my_msgs/Wheel", right)]
        return self("my_msgs/Custom", wheels, [self.pose(0.0, 0.0, 0.0), self.pose(*pose)])


def write_bag(folder: Path, name: str, kind: str, sent: Iterable[Sent]) -> Path:
    """Write messages as a bag of one of `KINDS`; return its path."""
    make = Make(is_ros1=kind.startswith("ros1"))
    if make.is_ros1:
        path = folder / f"{name}.bag"
        bag = Writer1(path)
        if "bz2" in kind:
            bag.set_compression(Writer1.CompressionFormat.BZ2)
        with bag:
            _write(bag, sent, make, make.store.serialize_ros1)
        return path
    path = folder / name
    storage = StoragePlugin.SQLITE3 if "sqlite3" in kind else StoragePlugin.MCAP
    writer = Writer2(path, version=8, storage_plugin=storage)
    if "zstd" in kind:
        modes = {"messages": CompressionMode.MESSAGE, "file": CompressionMode.FILE}
        writer.set_compression(modes.get(kind.rsplit(maxsplit=1)[-1], CompressionMode.STORAGE), CompressionFormat.ZSTD)
    with writer:
        _write(writer, sent, make, make.store.serialize_cdr)
    if kind == "mcap file":
        return (path / f"{name}.mcap").rename(folder / f"{name}.mcap")
    return path


def _write(writer: Any, sent: Iterable[Sent], make: Make, serialize: Callable[..., Any]) -> None:
    connections: dict[str, Any] = {}
    for ns, topic, made in sent:
        message = made(make)
        kind = message.__msgtype__
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=make.store)
        writer.write(connections[topic], ns, serialize(message, kind))


DIFFERENTIAL = """\
schema = 1
name = "ros"

[vehicle]
name = "rover"
kinematics = "differential"
rear_axle_m = 0.0
command_unit = "si"
neutral = 0.0

[mocap]
rate_hz = 50.0

[pose]
topic = "/pose"
clock = "absolute"

[columns]
drive = { topic = "/cmd_vel", column = "linear.x" }
front = { topic = "/cmd_vel", column = "angular.z" }

[runs]
shortest_s = 0.1
"""


def circle(rows: int = 60) -> list[tuple[int, float, float, float]]:
    """Return times [ns] and poses of a vehicle on a circle of 1 m at 0.5 m/s, at 50 Hz."""
    turns = [0.5 * row / 50 for row in range(rows)]
    return [(BEGAN_NS + 20_000_000 * row, math.sin(turn), 1.0 - math.cos(turn), turn) for row, turn in enumerate(turns)]


def driven(rows: int = 60, *, pose: str = "pose_stamped") -> list[Sent]:
    """Return a recording of the circle: poses 4 ms late, and every 60 ms a command that grows, from 30 ms before on."""
    sent = [
        Sent(ns + 4_000_000, "/pose", lambda make, ns=ns, numbers=numbers: getattr(make, pose)(ns, *numbers))
        for ns, *numbers in circle(rows)
    ]
    for number in range(rows // 3 + 1):
        twist = (0.5 + 0.01 * number, 0.5)
        sent.append(Sent(command_ns(number), "/cmd_vel", lambda make, twist=twist: make.twist(*twist)))
    return sorted(sent, key=lambda message: message.ns)


def command_ns(number: int) -> int:
    """Return when a command of `driven` is given [ns]."""
    return BEGAN_NS - 30_000_000 + 60_000_000 * number
