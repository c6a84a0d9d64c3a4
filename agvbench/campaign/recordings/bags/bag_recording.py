"""Read poses, commands and flags from a bag, as a mapping declares them, in one pass over its messages."""

from __future__ import annotations

from abc import ABC, abstractmethod
from array import array
from collections.abc import Iterator
from collections.abc import Mapping as Named
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.recordings.bags.bag import Bag, Message
from agvbench.campaign.recordings.bags.fields import Field, stamp_ns, vector
from agvbench.campaign.recordings.mapping import Flag, Mapping, PoseSource, Signal, Stamp
from agvbench.campaign.recordings.recording import Poses, Recording, combine
from agvbench.errors import FileError
from agvbench.types import Floats, TimeSeries
from agvbench.vehicle.quaternion import floor_poses

MAX_MESSAGES = 10_000_000
"""Of one topic: they are kept in memory as numbers."""
POSE_FIELDS = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    "geometry_msgs/msg/TransformStamped": "transform",
    "tf2_msgs/msg/TFMessage": "transform",
    "tf/msg/tfMessage": "transform",
    "nav_msgs/msg/Odometry": "pose.pose",
    "geometry_msgs/msg/Pose": "",
}
"""The field of the pose by type of message; that of each transform of a list of them."""
_DISORDER_S = 1.0


def read_bag_recording(path: Path, mapping: Mapping) -> Recording:
    """Read what `mapping` names from the bag `path`.

    Poses are rows, with the times that the mapping chooses; commands keep their own times.

    Raises
    ------
    FileError
        If the bag, a topic or a field is missing or cannot be read, stamps are zero, or time goes backwards.
    """
    with Bag(path) as bag:
        content = read_content(bag, mapping.pose or PoseSource(), mapping.sources)
        files = bag.files
    commands = {role: content.series[f"columns.{role}"] for role in mapping.commands}
    flags = {name: content.series[f"columns.{name}"].held_at(content.poses.t_s) == 1.0 for name in mapping.flags}
    logged = {name: content.series[f"logged.{name}"] for name in mapping.logged}
    return combine(path, files, mapping, content.poses, commands, flags, logged=logged, origin_s=content.origin_s)


class BagContent(NamedTuple):
    """Poses and, by name, the signals of a bag; their times count from ``origin_s`` [s since 1970].

    In seconds since 1970 a float would resolve 0.2 µs only.
    """

    poses: Poses
    series: dict[str, TimeSeries]
    origin_s: float


def read_content(bag: Bag, pose: PoseSource, signals: Named[str, Signal | Flag]) -> BagContent:
    """Return the poses, and the values of `signals` by name, from the messages of `bag`."""
    poses = _PoseTrack(bag, pose)
    tracks = {name: _SignalTrack(bag, signal) for name, signal in signals.items()}
    of_topic: dict[str, list[_Track]] = {}
    for track in (poses, *tracks.values()):
        of_topic.setdefault(track.topic, []).append(track)
    for message in bag.messages(list(of_topic)):
        for track in of_topic[message.topic]:
            track.add(message)
    rows, origin_ns = poses.poses()
    series = {name: track.series(origin_ns) for name, track in tracks.items()}
    return BagContent(rows, series, origin_ns * 1e-9)


class _Track(ABC):
    """The times and numbers of one source, collected message by message."""

    def __init__(self, bag: Bag, topic: str | None, time: Stamp) -> None:
        assert topic is not None  # noqa: S101 - load_mapping makes sure that topics are named
        self.topic, self.type = topic, bag.topic(topic).type
        self._path, self._time = bag.path, time
        self._ns = array("q")

    @abstractmethod
    def add(self, message: Message) -> None:
        """Take what the source needs from a message."""

    def _stamp(self, message: Any, received_ns: int) -> None:
        stamp = stamp_ns(message) if self._time == "header" else None
        if stamp is not None and stamp <= 0:
            raise FileError(
                f"topic {self.topic} has messages without a stamp in their headers", where=self._path,
                remedy='set time = "received" for it in the mapping',
            )  # fmt: skip
        if len(self._ns) >= MAX_MESSAGES:
            what = f"topic {self.topic} has too many messages"
            raise FileError(what, where=self._path, limit=f"{MAX_MESSAGES}", remedy="split the bag")
        self._ns.append(received_ns if stamp is None else stamp)

    def _in_order(self, origin_ns: int | None = None) -> tuple[NDArray[np.int64], Floats, int]:
        """Return the order of the messages by time, and their times [s] since `origin_ns`, by default the first.

        A clock that was set back is refused.
        """
        ns = np.frombuffer(self._ns, np.int64) if len(self._ns) else np.empty(0, np.int64)
        back = np.flatnonzero(np.diff(ns) < -_DISORDER_S * 1e9)
        if len(back):
            what = f"message {back[0] + 2} of topic {self.topic}: time goes backwards"
            step_s = (ns[back[0] + 1] - ns[back[0]]) * 1e-9
            remedy = 'split the bag there, or set time = "received"'
            raise FileError(what, where=self._path, value=f"{step_s:.6g} s", remedy=remedy)
        order = np.argsort(ns, kind="stable").astype(np.int64)
        origin_ns = int(ns[order[:1]].sum()) if origin_ns is None else origin_ns
        return order, np.asarray((ns[order] - origin_ns) * 1e-9, np.float64), origin_ns


class _SignalTrack(_Track):
    """A command, a flag or what else was logged; NaN gives none, and an array that is empty neither."""

    def __init__(self, bag: Bag, signal: Signal | Flag) -> None:
        super().__init__(bag, signal.topic, signal.time)
        self._signal, self._field = signal, Field(signal.column, self.topic, bag.path)
        self._values = array("d")

    def add(self, message: Message) -> None:
        value = self._value(message.content)
        if np.isinf(value):
            what = f"topic {self.topic}: {self._signal.column} is infinite"
            raise FileError(what, where=self._path, remedy="correct what publishes it")
        if not np.isnan(value):
            self._stamp(message.content, message.received_ns)
            self._values.append(value)

    def _value(self, content: Any) -> float:
        signal = self._signal
        if isinstance(signal, Signal):
            return self._field.number(content) * signal.scale + signal.offset
        found = self._field.of(content)
        if isinstance(signal.equals, bool | str):
            return float(str(found).strip().lower() == str(signal.equals).lower())
        return float(self._field.number(content) == signal.equals)

    def series(self, origin_ns: int) -> TimeSeries:
        """Return the values in order of their times [s] since `origin_ns`."""
        order, t_s, _ = self._in_order(origin_ns)
        return TimeSeries(t_s, np.array(self._values)[order])


class _PoseTrack(_Track):
    """The poses of one body."""

    def __init__(self, bag: Bag, source: PoseSource) -> None:
        super().__init__(bag, source.topic, source.time)
        self._source = source
        self._numbers = array("d")
        self._children: set[str] = set()
        if source.field is None and self.type not in POSE_FIELDS:
            types = ", ".join(POSE_FIELDS)
            remedy = f"give the topic of one of these types, or pose.field: {types}"
            raise FileError(f"topic {self.topic} is no pose", where=bag.path, value=self.type, remedy=remedy)
        self._field = POSE_FIELDS[self.type] if source.field is None else source.field
        self._pose = Field(self._field, self.topic, bag.path)

    def add(self, message: Message) -> None:
        for content in self._bodies(message.content):
            try:
                numbers = _pose(self._pose.of(content))
            except (AttributeError, TypeError):
                what = f"topic {self.topic}: field {self._field!r} is no pose"
                remedy = "give the field that has position and orientation, or translation and rotation"
                raise FileError(what, where=self._path, remedy=remedy) from None
            self._stamp(content, message.received_ns)
            self._numbers.extend(numbers)

    def _bodies(self, content: Any) -> Iterator[Any]:
        """Yield the message itself, or those of its transforms that are of the body."""
        wanted = self._source.child_frame_id
        for part in getattr(content, "transforms", [content]):
            child = str(getattr(part, "child_frame_id", ""))
            if wanted is None or child == wanted:
                yield part
            self._children.add(child[:80])
        if wanted is None and len(self._children) > 1:
            raise FileError(
                f"topic {self.topic} has poses of several bodies", where=self._path,
                value=", ".join(sorted(self._children)[:20]), remedy="name one in pose.child_frame_id",
            )  # fmt: skip

    def poses(self) -> tuple[Poses, int]:
        """Return the poses in order of their times [s] since the first, and when that was [ns since 1970]."""
        order, t_s, origin_ns = self._in_order()
        if not len(order):
            has = ", ".join(sorted(self._children)[:20])
            what = f"topic {self.topic} has no pose of {self._source.child_frame_id} (it has {has})"
            raise FileError(what, where=self._path, remedy="correct pose.child_frame_id")
        rows, source = np.array(self._numbers).reshape(-1, 7)[order], self._source
        axes = (source.forward, source.floor_x, source.floor_y)
        return Poses.of(t_s, *floor_poses(rows[:, :3], rows[:, 3:], *axes)), origin_ns


def _pose(content: Any) -> tuple[float, ...]:
    """Return x, y, z, qx, qy, qz, qw of a pose or a transform."""
    if hasattr(content, "rotation"):
        return vector(content.translation, "xyz") + vector(content.rotation, "xyzw")
    return vector(content.position, "xyz") + vector(content.orientation, "xyzw")
