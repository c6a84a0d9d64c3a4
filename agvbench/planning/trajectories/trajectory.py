"""What a trajectory is: a name, how to steer and how fast, and one shape (schema 1)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Literal, cast

import msgspec
from msgspec import Meta, Struct

from agvbench.notebook_html import heading_html, table_html
from agvbench.planning.trajectories.segments import Segment, Speed, Steering, check_speed
from agvbench.planning.trajectories.shapes import (
    CommandTable,
    DubinsShape,
    Endurance,
    PoseTable,
    SCurve,
    Shape,
    Slalom,
    SpeedSteps,
    StepSteer,
)
from agvbench.types import NO_TARGET, Pose

if TYPE_CHECKING:
    from agvbench.model import VehicleModel

SHAPES = ("segments", "dubins", "s_curve", "slalom", "step_steer", "speed_steps", "endurance", "commands")
_MOST = 12
TRAJECTORY_NAME = re.compile("[A-Za-z0-9][A-Za-z0-9_.-]*")
Condition = Literal["uncalibrated", "calibrated", "corrected"]


class Trajectory(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A trajectory as it stands in TOML; exactly one of the eight shapes is given.

    Parameters
    ----------
    schema
        1.
    name
        What tables and run ids call it: letters, digits, ``_``, ``.`` and ``-``.
    description
        One line.
    conditions
        The conditions under which it can be driven.
    speed
        ``"full"``, ``"half"``, a share such as ``"75%"``, or the axles' speed in m/s; a segment may have its own.
    steering
        Which axles steer: ``"abeam"`` (both, centre of rotation abeam of the centroid), ``"front"``, ``"rear"``,
        ``"opposite"`` (both, equal angles) or ``"crab"``; a segment may have its own.
    steer_first_s
        How long the steering is set before the drive starts [s], so that its lag does not count.
    steer_at_rest
        Stop for `steer_first_s` wherever the steering changes; otherwise it changes while driving.
    target
        The target in the start frame, ``"none"``, or left out: where the kinematics lead.
    """

    schema: Literal[1]
    name: str
    description: str = ""
    conditions: Annotated[tuple[Condition, ...], Meta(min_length=1)] = ("uncalibrated", "calibrated", "corrected")
    speed: Speed = "full"
    steering: Steering = "abeam"
    steer_first_s: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.5
    steer_at_rest: bool = False
    target: PoseTable | Literal["none"] | None = None
    segments: Annotated[tuple[Segment, ...], Meta(min_length=1)] | None = None
    dubins: DubinsShape | None = None
    s_curve: SCurve | None = None
    slalom: Slalom | None = None
    step_steer: StepSteer | None = None
    speed_steps: SpeedSteps | None = None
    endurance: Endurance | None = None
    commands: CommandTable | None = None

    def __post_init__(self) -> None:
        if not TRAJECTORY_NAME.fullmatch(self.name):
            raise ValueError(f"name is not made of letters, digits, '_', '.' and '-': {self.name!r}")
        check_speed(self.speed)
        given = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(given) != 1:
            raise ValueError(
                f"exactly one shape is needed: {', '.join(given) or 'none'} given (one of: {', '.join(SHAPES)})"
            )

    @property
    def shape(self) -> str:
        """The name of the shape that is given."""
        return next(shape for shape in SHAPES if getattr(self, shape) is not None)

    @property
    def experiment(self) -> str:
        """The kind of experiment that a run of it is: ``"trajectory"``, ``"step"``, ``"endurance"`` or ``"free"``."""
        kinds = {"step_steer": "step", "speed_steps": "step", "endurance": "endurance", "commands": "free"}
        return kinds.get(self.shape, "trajectory")

    @property
    def stated_target(self) -> Pose | None:
        """The target that the trajectory states, `NO_TARGET` for none, or None where the kinematics decide."""
        if isinstance(self.target, PoseTable):
            return self.target.pose
        # Circles for hours and raw commands aim at no pose.
        aims_at_none = self.target == "none" or self.shape in ("endurance", "commands")
        return NO_TARGET if aims_at_none else None

    def expand(self) -> tuple[Segment, ...]:
        """Return the segments of its shape (none for raw commands, which are no path)."""
        if self.segments is not None:
            return self.segments
        shape: Shape | CommandTable = getattr(self, self.shape)
        return () if isinstance(shape, CommandTable) else shape.segments()

    def segment_name(self, index: int) -> str:
        """Return how messages call segment `index`: ``"u_turn: dubins[2]"``."""
        return f"{self.name}: {self.shape}[{index}]"

    def _repr_html_(self) -> str:
        line = (
            f"{self.shape.replace('_', ' ')}; speed {self.speed}, steering {self.steering}, "
            f"conditions {', '.join(self.conditions)}"
        )
        segments = self.expand()
        rows = [(str(index), *_row(segment)) for index, segment in enumerate(segments[:_MOST])]
        rows += [("…", f"{len(segments) - _MOST} more", "")] if len(segments) > _MOST else []
        return heading_html(self.name, self.description, line) + table_html("segments", ["", "kind", "sets"], rows)

    def with_steering(self, steering: Steering) -> Trajectory:
        """Return the same trajectory steered in another mode; its target is then where the kinematics lead.

        A target that was stated for one mode is not that of another: steered by the front axle alone, a quarter turn
        has the same chord in another direction.
        """
        stated = isinstance(self.target, PoseTable) and steering != self.steering
        return msgspec.structs.replace(self, steering=steering, target=None if stated else self.target)

    def to_table(self) -> dict[str, object]:
        """Return the trajectory as it would stand in TOML or JSON, without what is left at its default."""
        return cast(dict[str, object], _without_none(msgspec.to_builtins(self)))


def steered(trajectory: Trajectory, mode: str, model: VehicleModel) -> Trajectory:
    """Return the trajectory steered in this mode (`Trajectory.with_steering`), or for "" as `model` can steer it.

    A vehicle with one steered axle drives with it what is stated for both (``abeam``, ``opposite``).
    """
    if not mode and trajectory.steering in ("abeam", "opposite"):
        mode = _one_axle(model)
    return trajectory.with_steering(cast(Steering, mode)) if mode else trajectory


def _one_axle(model: VehicleModel) -> str:
    """Return which axle steers where the other one does not, or "" for both (or none)."""
    front, rear = (low < high for low, high in (model.front.output_range, model.rear.output_range))
    return "" if front == rear else "front" if front else "rear"


def _without_none(value: object) -> object:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_without_none(item) for item in value]
    return value


def _row(segment: msgspec.Struct) -> tuple[str, str]:
    table = msgspec.to_builtins(segment)
    kind = str(table.pop("kind", type(segment).__name__))
    return kind, ", ".join(f"{name} = {_short(value)}" for name, value in table.items() if value is not None)


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
