"""The how-to's adapter of a ROS 2 vehicle, against a Zenoh router that speaks as zenoh-bridge-ros2dds does."""

from __future__ import annotations

import json
import math
import re
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh
from rosbags.typesys import Stores, get_typestore

from agvbench.adapters import open_rig
from agvbench.cli import main
from agvbench.errors import LinkError
from agvbench.simulator import differential_plant
from agvbench.types import Command
from agvbench.vehicle.channels import Channels

pytestmark = pytest.mark.real_time

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "exchange-with-ros.md"
ROS = get_typestore(Stores.ROS2_HUMBLE)


class Bridge:
    """A router with the keys and payloads of the bridge, and behind it a simulated robot, in a thread."""

    def __init__(self, port: int) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.endpoint, self.twists, self.late_s = f"tcp/127.0.0.1:{port}", [], 0.0
        self.session = zenoh.open(config)
        self.session.declare_subscriber("agv1/cmd_vel", self._command)
        self.publisher = self.session.declare_publisher("agv1/pose")
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def _command(self, sample: zenoh.Sample) -> None:
        self.twists.append(ROS.deserialize_cdr(sample.payload.to_bytes(), "geometry_msgs/msg/Twist"))

    def _live(self) -> None:
        plant, before_s = differential_plant(0), time.monotonic()
        plant.reset((0.2, -0.1, 0.0), seed=0)
        while not self._over.wait(0.01):
            newest, now_s = self.twists[-1] if self.twists else None, time.monotonic()
            speed, turn = (newest.linear.x, newest.angular.z) if newest else (0.0, 0.0)
            pose = plant.advance(speed, turn, turn, now_s - before_s)
            before_s = now_s
            self.publisher.put(self._pose(time.time_ns() - round(self.late_s * 1e9), *pose))

    def _pose(self, ns: int, x: float, y: float, heading: float) -> bytes:
        new = ROS.types
        stamp = new["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
        turned = new["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))
        pose = new["geometry_msgs/msg/Pose"](new["geometry_msgs/msg/Point"](x, y, 0.0), turned)
        message = new["geometry_msgs/msg/PoseStamped"](new["std_msgs/msg/Header"](stamp, "map"), pose)
        return bytes(ROS.serialize_cdr(message, "geometry_msgs/msg/PoseStamped"))

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self.session.close()


@pytest.fixture
def bridge(free_port: Callable[[], int]) -> Iterator[Bridge]:
    opened = Bridge(free_port())
    yield opened
    opened.close()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    source = re.search(r'```python\n("""ros2_lab\.py.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert source is not None
    path = tmp_path / "ros2_lab.py"
    path.write_text(source[1], encoding="utf-8")
    return path


def test_the_cameras_keep_the_contract(bridge, file, capsys):
    assert main(["mocap", f"{file}:{bridge.endpoint}", "--check"]) == 0
    assert "failed" not in capsys.readouterr().out


def test_the_vehicle_keeps_the_contract(bridge, file, capsys):
    assert main(["agv", f"{file}:{bridge.endpoint}", "--check"]) == 0
    assert "failed" not in capsys.readouterr().out


def test_commands_reach_the_robot_and_its_poses_come_back(bridge, file):
    spec = f"{file}:{bridge.endpoint}"
    with open_rig(agv=spec, mocap=spec, seed=0, channels=Channels.alike("si")) as link:
        bridge.late_s = 0.05
        at_rest = link.control_cycle(Command(0.0, 0.0, 0.0), t_s=0.0, hold_s=0.5)
        driving = link.control_cycle(Command(0.4, 0.3, 0.0), t_s=0.5, hold_s=1.0)
        link.control_cycle(Command(0.0, 0.0, 0.0), t_s=1.5, hold_s=0.3)
    assert [(twist.linear.x, twist.angular.z) for twist in bridge.twists if twist.linear.x][:1] == [(0.4, 0.3)]
    assert (at_rest.x_m[0], at_rest.y_m[0]) == pytest.approx((0.2, -0.1), abs=1e-6)
    assert 0.1 < driving.x_m[-1] - 0.2 < 0.6
    assert driving.heading_rad[-1] > 0.05
    late_s = driving.received_s - driving.t_s
    assert late_s == pytest.approx(0.05, abs=0.02)


def test_a_payload_that_is_no_pose_stops_the_run_with_one_line(bridge, file):
    spec = f"{file}:{bridge.endpoint}"
    with open_rig(agv=spec, mocap=spec, seed=0, channels=Channels.alike("si")) as link:
        link.control_cycle(Command(0.0, 0.0, 0.0), t_s=0.0, hold_s=0.3)
        bridge.session.put("agv1/pose", b"\x00\x01\x00\x00short")
        with pytest.raises(LinkError, match="agv1/pose: not a PoseStamped"):
            link.control_cycle(Command(0.0, 0.0, 0.0), t_s=0.3, hold_s=10.0)


def test_without_a_bridge_the_command_says_so_in_one_line(file, free_port, capsys):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    assert main(["mocap", f"{file}:{endpoint}", "--check"]) == 1
    assert f"{endpoint}: no bridge answers; start zenoh-bridge-ros2dds there" in capsys.readouterr().out
