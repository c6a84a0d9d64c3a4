"""Bags and TUM files that cannot be imported: one function per case, each raising its one-line error."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from bad_campaigns import Cases
from campaign_samples import MAPPING, recording, write_csv
from ros_bags import BEGAN_NS, DIFFERENTIAL, Sent, circle, driven, write_bag

from agvbench.campaign import import_recordings
from agvbench.campaign.recordings.bags import bag_recording, definitions
from agvbench.campaign.recordings.guess import guess_mapping


def _import(path: str | Path, mapping: str = DIFFERENTIAL) -> None:
    Path("mapping.toml").write_text(mapping)
    import_recordings("mapping.toml", [path], "c")


def _bag(sent: list[Sent] | None = None, mapping: str = DIFFERENTIAL, kind: str = "mcap") -> Callable[[], None]:
    return lambda: _import(write_bag(Path(), "b", kind, driven() if sent is None else sent), mapping)


def _mapping(old: str, new: str) -> Callable[[], None]:
    assert old in DIFFERENTIAL
    return _bag(mapping=DIFFERENTIAL.replace(old, new))


def _file(name: str, content: bytes) -> Callable[[], None]:
    def run() -> None:
        Path(name).write_bytes(content)
        _import(name)

    return run


def _cut(kind: str, file: str, share: float) -> Callable[[], None]:
    def run() -> None:
        bag = write_bag(Path(), "b", kind, driven())
        path = bag / file if bag.is_dir() else bag
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * share)])
        _import(bag)

    return run


def _without(name: str) -> Callable[[], None]:
    def run() -> None:
        bag = write_bag(Path(), "b", "mcap", driven())
        (bag / name).unlink()
        _import(bag)

    return run


def _stamps(change: Callable[[int], int], pose: str = "pose_stamped") -> list[Sent]:
    poses = [Sent(ns, "/pose", lambda make, ns=ns, p=p: getattr(make, pose)(change(ns), *p)) for ns, *p in circle()]
    return sorted(poses + [m for m in driven() if m.topic == "/cmd_vel"], key=lambda m: m.ns)


def _lowered(module: object, name: str, value: int) -> Callable[[], None]:
    def run() -> None:
        with mock.patch.object(module, name, value):
            _bag()()

    return run


def _not_installed() -> None:
    bag = write_bag(Path(), "b", "mcap", driven())
    with mock.patch.dict(sys.modules, {"rosbags.rosbag2": None}):
        _import(bag)


def _wrong_size() -> None:
    """A message whose bytes are those of another type."""
    _bag([m._replace(make=lambda make: make.number(1.0)) if m.topic == "/pose" else m for m in driven()])()


TUM = """\
[pose]
clock = "file"

[columns]
time = { column = "t", unit = "ms" }
drive = { column = "throttle" }
front = { column = "steer" }

[runs]
shortest_s = 0.1
"""
TUM = MAPPING[: MAPPING.index("[columns]")] + TUM


def _tum(lines: str, *, commands: dict[str, list[object]] | None = None) -> Callable[[], None]:
    def run() -> None:
        Path("r.tum").write_text(lines)
        if commands is not None:
            write_csv(Path("r.csv"), commands)
        _import("r.tum", TUM)

    return run


def _line(t: float) -> str:
    return f"{t} {t / 2} 0 0 0 0 0 1\n"


_POSES = "".join(_line(row / 100) for row in range(60))
_POSE, _DRIVE = 'topic = "/pose"', 'drive = { topic = "/cmd_vel", column = "linear.x" }'

CASES: Cases = {
    "mapping-topic-missing": ("a command without a topic", _mapping(_DRIVE, 'drive = { column = "linear.x" }')),
    "mapping-topic-csv": (
        "a topic in the mapping of a CSV",
        lambda: _import("r.csv", MAPPING.replace('column = "throttle"', 'topic = "/a", column = "throttle"')),
    ),
    "mapping-pose-twice": (
        "`[pose]` beside `columns.x`",
        _mapping("[columns]", '[columns]\nx = { column = "x", unit = "m" }'),
    ),
    "mapping-pose-axes": ("a floor whose x and y are one axis", _mapping(_POSE, _POSE + '\nfloor_x = "-y"')),
    "bag-not-installed": ("a bag without the extra `ros`", _not_installed),
    "bag-absent": ("a bag that does not exist", lambda: _import("b")),
    "bag-no-metadata": ("a directory that is no bag", _without("metadata.yaml")),
    "bag-no-file": ("a bag whose file was deleted", _without("b.mcap")),
    "bag-foreign": ("a file named `.mcap` that is none", _file("b.mcap", b"t,x,y\n0,0,0\n")),
    "bag-foreign-1": ("a file named `.bag` that is none", _file("b.bag", b"t,x,y\n0,0,0\n")),
    "bag-empty": ("a file of 0 bytes", _file("b.mcap", b"")),
    "bag-cut-mcap": ("an MCAP file that was cut off", _cut("mcap file", "", 0.5)),
    "bag-cut-sqlite": ("an SQLite file that was cut off", _cut("sqlite3", "b.db3", 0.1)),
    "bag-cut-1": ("a bag of ROS 1 that was cut off", _cut("ros1", "", 0.5)),
    "bag-of-csv": ("a CSV with the mapping of a bag", lambda: _import(write_csv(Path("r.csv"), recording()))),
    "csv-of-bag": ("a bag with the mapping of a CSV", _bag(mapping=MAPPING)),
    "bag-topic": ("a topic that the bag lacks", _mapping(_POSE, 'topic = "/odom"')),
    "bag-type": ("a topic of commands as pose", _mapping(_POSE, 'topic = "/cmd_vel"')),
    "bag-type-field": (
        "a field of the pose that is none",
        _mapping(_POSE, _POSE + '\nfield = "pose.position"'),
    ),
    "bag-field": ("a field that the type lacks", _mapping('"linear.x"', '"linear.v"')),
    "bag-field-no-number": ("a field that is no number", _mapping('"linear.x"', '"linear"')),
    "bag-field-path": ("a path that is none", _mapping('"linear.x"', '"linear..x"')),
    "bag-stamps": ("headers without stamps", _bag(_stamps(lambda ns: 0))),
    "bag-clocks": ("stamps of poses in another clock than the commands", _bag(_stamps(lambda ns: ns - BEGAN_NS + 1))),
    "bag-backwards": (
        "a clock that was set back",
        _bag(_stamps(lambda ns: ns - 5 * 10**9 if ns > circle()[30][0] else ns)),
    ),
    "bag-bodies": ("transforms of several bodies", _bag(_stamps(lambda ns: ns, "tf"))),
    "bag-body": (
        "a body that is not there",
        _bag(_stamps(lambda ns: ns, "tf"), DIFFERENTIAL.replace(_POSE, _POSE + '\nchild_frame_id = "agv"')),
    ),
    "bag-infinite": (
        "an infinite command",
        _bag([*driven(), Sent(circle()[59][0] + 1, "/cmd_vel", lambda make: make.twist(math.inf, 0.0))]),
    ),
    "bag-number-as-pose": ("a topic of another type than the pose", _wrong_size),
    "bag-too-many": ("more messages than the limit (lowered to 5 here)", _lowered(bag_recording, "MAX_MESSAGES", 5)),
    "bag-large-type": (
        "a type of more elements than the limit (lowered to 5 here)",
        _lowered(definitions, "MAX_ELEMENTS", 5),
    ),
    "bag-guess-pose": (
        "a guess from a bag without poses",
        lambda: guess_mapping(write_bag(Path(), "b", "mcap", [m for m in driven() if m.topic == "/cmd_vel"])),
    ),
    "bag-guess-command": (
        "a guess from a bag without commands",
        lambda: guess_mapping(write_bag(Path(), "b", "mcap", [m for m in driven() if m.topic == "/pose"])),
    ),
    "tum-no-commands": ("a TUM file without commands beside it", _tum(_POSES)),
    "tum-columns": ("a TUM file with a column too few", _tum("0 0 0 0 0 0 1\n", commands=recording())),
    "tum-text": ("a TUM file with text in it", _tum(_POSES + "0.7 a 0 0 0 0 0 1\n", commands=recording())),
    "tum-empty": ("a TUM file without lines", _tum("# nothing\n", commands=recording())),
    "tum-backwards": ("poses whose time goes backwards", _tum(_POSES + _line(0.1), commands=recording())),
    "tum-clocks": (
        "poses since 1970 beside commands since the start",
        _tum(
            "".join(f"{1700000000 + row / 100:.2f} {row / 200} 0 0 0 0 0 1\n" for row in range(60)),
            commands=recording(),
        ),
    ),
}
