"""Guess the mapping of a bag: poses and commands by the types of topics, else by their names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from agvbench.campaign.recordings.bags.bag import Bag, Topic
from agvbench.campaign.recordings.bags.bag_recording import POSE_FIELDS, read_content
from agvbench.campaign.recordings.bags.fields import numbers_in, stamp_ns
from agvbench.campaign.recordings.guess_columns import (
    AGREES,
    MEASURED,
    Columns,
    courses,
    mapping_text,
    plain,
)
from agvbench.campaign.recordings.mapping import PoseSource, Signal, Stamp
from agvbench.errors import FileError, visible
from agvbench.types import Floats

COMMAND_FIELDS = {
    "ackermann_msgs/msg/AckermannDriveStamped": ("drive.speed", "drive.steering_angle"),
    "ackermann_msgs/msg/AckermannDrive": ("speed", "steering_angle"),
    "geometry_msgs/msg/TwistStamped": ("twist.linear.x", "twist.angular.z"),
    "geometry_msgs/msg/Twist": ("linear.x", "angular.z"),
}
"""The fields of drive and front, in SI units, by type of message."""
_ODOMETRY, _TRANSFORMS = "nav_msgs/msg/Odometry", ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_BODIES = ("base_link", "base_footprint")
_LOOKED_AT = 1000
_NAMED_NUMBERS = "std_msgs/msg/"
_NAME = re.compile(r"[\w/~.:-]+", re.ASCII)


def topic_lines(path: Path) -> list[str]:
    """Return a line for each topic of a bag: its name, type, number of messages and mean rate."""
    with Bag(path) as bag:
        return _lines(bag)


def _lines(bag: Bag) -> list[str]:
    width = max((len(topic.name) for topic in bag.topics), default=0)
    return [
        visible(f"{topic.name:{width}}  {topic.type}, {topic.count} messages")
        + (f", {(topic.count - 1) / bag.duration_s:.4g} Hz" if topic.count > 1 and bag.duration_s else "")
        for topic in bag.topics
    ]


def guess_bag_mapping(path: Path) -> tuple[str, list[str]]:
    """Return the text of a mapping for a bag, and what it leaves to answer, one line each.

    Raises
    ------
    FileError
        If the bag cannot be read, or no topic looks like a pose or a command.
    """
    with Bag(path) as bag:
        comments = [f"# {line}" for line in _lines(bag)]
        columns = Columns(path, {})
        source = _pose(bag, columns.questions)
        signals = _signals(bag, columns, source)
        poses, series, _ = read_content(bag, source, signals)
    columns.numbers = {name: one.value for name, one in series.items()}
    columns.keys = {name: _keys(signal) for name, signal in signals.items()}
    position = np.column_stack([poses.x_m, poses.y_m])
    _ask_about_heading(position, poses.heading_rad, columns)
    pose = [f'{key} = "{getattr(source, key)}"' for key in ("topic", "child_frame_id", "time", "clock")]
    pose = [line for line in pose if not line.endswith(('"None"', '"header"'))]
    motion = (poses.t_s, position, poses.heading_rad)
    return mapping_text(columns, comments, {"pose": pose}, [], motion), columns.questions


def _usable(bag: Bag) -> list[Topic]:
    """Return the topics that have messages, and a name that can stand in a mapping."""
    return [topic for topic in bag.topics if topic.count and _NAME.fullmatch(topic.name)]


def _pose(bag: Bag, questions: list[str]) -> PoseSource:
    """Return the topic of the pose: one of a pose before odometry, and of these the one with the most messages."""
    order = list(POSE_FIELDS)
    found = sorted(
        (topic for topic in _usable(bag) if topic.type in POSE_FIELDS),
        key=lambda topic: (topic.type == _ODOMETRY, topic.type in _TRANSFORMS, -topic.count, order.index(topic.type)),
    )
    if not found:
        raise _nothing_like("a pose", bag, POSE_FIELDS)
    chosen, *others = found
    if others:
        questions.append(f"pose: {chosen.name}, or {_names(others)}?")
    if chosen.type == _ODOMETRY:
        questions.append(f"{chosen.name}: measured from outside the vehicle? Odometry of wheels does not see slip")
    first = _first(bag, chosen)
    body = _body(bag, chosen, questions) if chosen.type in _TRANSFORMS else None
    stamped = first.transforms[0] if body and first.transforms else first
    return PoseSource(topic=chosen.name, child_frame_id=body, time=_time(stamped, chosen, questions), clock="absolute")


def _body(bag: Bag, topic: Topic, questions: list[str]) -> str:
    """Return which of the transforms is that of the vehicle: one with the usual name, else the most frequent."""
    seen = Counter(
        str(transform.child_frame_id)
        for message in islice(bag.messages([topic.name]), _LOOKED_AT)
        for transform in message.content.transforms
        if _NAME.fullmatch(str(transform.child_frame_id))
    )
    if not seen:
        raise _nothing_like("a pose", bag, POSE_FIELDS)
    body = min(seen, key=lambda name: (name not in _BODIES, -seen[name], name))
    if others := sorted(set(seen) - {body}):
        questions.append(f"{topic.name}: the vehicle is {body}, or one of {', '.join(others[:20])}?")
    return body


def _signals(bag: Bag, columns: Columns, source: PoseSource) -> dict[str, Signal]:
    """Return the commands and flags to read, by names of columns; drive and front are taken in `columns`."""
    topics = [topic for topic in _usable(bag) if topic.name != source.topic]
    typed = sorted((topic for topic in topics if topic.type in COMMAND_FIELDS), key=_rank)
    numbers = [topic for topic in topics if topic.type.startswith(_NAMED_NUMBERS)]
    if typed:
        chosen, *others = typed
        if others:
            columns.questions.append(f"commands: {chosen.name}, or {_names(others)}?")
        fields = COMMAND_FIELDS[chosen.type]
        columns.taken = dict(zip(("drive", "front"), (f"{chosen.name} {field}" for field in fields), strict=True))
        columns.is_si = True
        signals = _signals_of(bag, chosen, fields, columns.questions)
        numbers = [topic for topic in numbers if topic.type.endswith("/Bool")]
    else:
        signals = {}
    for topic in numbers:
        signals |= _signals_of(bag, topic, numbers_in(_first(bag, topic)), columns.questions)
    columns.numbers = dict.fromkeys(signals, np.empty(0))
    for role in () if typed else ("drive", "front"):
        if columns.take(role) is None:
            raise _nothing_like(f"the command of {role}", bag, COMMAND_FIELDS)
    return signals


def _rank(topic: Topic) -> tuple[bool, bool, int, int]:
    """Return what sorts topics of commands: measured speeds last, names of commands first."""
    name = plain(topic.name)
    order = list(COMMAND_FIELDS).index(topic.type)
    return bool(MEASURED.search(name)), not any(part in name for part in ("cmd", "command")), order, -topic.count


def _signals_of(bag: Bag, topic: Topic, fields: Iterable[str], questions: list[str]) -> dict[str, Signal]:
    time = _time(_first(bag, topic), topic, questions)
    return {f"{topic.name} {field}": Signal(column=field, topic=topic.name, time=time) for field in fields}


def _keys(signal: Signal) -> str:
    time = "" if signal.time == "header" else f', time = "{signal.time}"'
    return f'topic = "{signal.topic}", column = "{signal.column}"{time}'


def _first(bag: Bag, topic: Topic) -> Any:
    return next(iter(bag.messages([topic.name]))).content


def _time(message: Any, topic: Topic, questions: list[str]) -> Stamp:
    """Return which time of a topic's messages is known."""
    if stamp_ns(message) not in (None, 0):
        return "header"
    if stamp_ns(message) == 0:
        questions.append(f"{topic.name}: its headers have no stamps; is the time of recording good enough?")
        return "received"
    return "header"


def _ask_about_heading(position: Floats, heading_rad: Floats, columns: Columns) -> None:
    moving, course = courses(position)
    difference = course - heading_rad[1:][moving]
    difference = difference[np.isfinite(difference)]
    if len(difference) and np.mean(np.cos(2.0 * difference)) < AGREES:  # a vehicle may drive backward
        columns.questions.append("pose: the heading does not follow the direction of travel; which axis is forward?")


def _names(topics: Iterable[Topic]) -> str:
    return ", ".join(topic.name for topic in topics)


def _nothing_like(what: str, bag: Bag, types: Iterable[str]) -> FileError:
    has = ", ".join(f"{topic.name} ({topic.type})" for topic in bag.topics[:20])
    return FileError(
        f"no topic looks like {what}", where=bag.path, value=has, limit=f"one of the types {', '.join(types)}",
        remedy="write the mapping by hand (docs/how-to/exchange-with-ros.md)",
    )  # fmt: skip
