"""Shapes: what a trajectory's TOML may hold instead of a list of segments; each expands into segments."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Protocol

from msgspec import Meta, Struct

from agvbench.planning.shortest_paths import dubins, reeds_shepp
from agvbench.planning.shortest_paths.pieces import Piece
from agvbench.planning.trajectories.segments import (
    Arc,
    AxleAngle,
    Direction,
    Duration,
    Length,
    Radius,
    Segment,
    Speed,
    Straight,
    Turn,
    TurnAngle,
    alternating,
    check_speed,
    exactly_one,
    from_pieces,
)
from agvbench.types import Pose
from agvbench.vehicle.channels import TableUnit

Coordinate = Annotated[float, Meta(ge=-10_000.0, le=10_000.0)]
Heading = Annotated[float, Meta(ge=-36_000.0, le=36_000.0)]
_SHORTEST = {
    "forward": dubins.shortest_path,
    "backward": dubins.shortest_path_backward,
    "either": reeds_shepp.shortest_path,
}


class Shape(Protocol):
    """What expands into segments."""

    def segments(self) -> tuple[Segment, ...]:
        """Return the segments of the shape, in the order in which they are driven."""


class PoseTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A pose in TOML: metres and degrees."""

    x_m: Coordinate
    y_m: Coordinate
    heading_deg: Heading

    @property
    def pose(self) -> Pose:
        """The pose, in radians."""
        return Pose(self.x_m, self.y_m, math.radians(self.heading_deg))


class DubinsShape(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The shortest path of arcs and straights from `start` over every `via` to `goal`.

    `direction` is ``"forward"`` or ``"backward"`` (Dubins), or ``"either"`` (Reeds-Shepp, with changes of gear).
    """

    goal: PoseTable
    radius_m: Radius
    start: PoseTable = PoseTable(x_m=0.0, y_m=0.0, heading_deg=0.0)
    via: tuple[PoseTable, ...] = ()
    direction: Literal["forward", "backward", "either"] = "forward"

    def segments(self) -> tuple[Segment, ...]:
        """Return the segments of the path."""
        poses = [table.pose for table in (self.start, *self.via, self.goal)]
        shortest = _SHORTEST[self.direction]
        pieces: list[Piece] = []
        for start, goal in pairwise(poses):
            pieces += shortest(start, goal, self.radius_m)
        return from_pieces(tuple(pieces))


class SCurve(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Two arcs, to one side and back: a change of lane. `turn` is the side of the first."""

    turn: Turn
    radius_m: Radius
    angle_deg: TurnAngle
    direction: Direction = "forward"

    def segments(self) -> tuple[Segment, ...]:
        """Return the two arcs."""
        first = Arc(turn=self.turn, radius_m=self.radius_m, angle_deg=self.angle_deg, direction=self.direction)
        return alternating(first, (self.angle_deg, self.angle_deg))


class Slalom(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Arcs to one side and the other about a straight line, which the vehicle leaves and meets at `angle_deg`."""

    turn: Turn
    radius_m: Radius
    angle_deg: TurnAngle
    arcs: Annotated[int, Meta(ge=2, le=1000)]
    direction: Direction = "forward"

    def segments(self) -> tuple[Segment, ...]:
        """Return the arcs; the first and the last are half as long as those between."""
        first = Arc(turn=self.turn, radius_m=self.radius_m, angle_deg=self.angle_deg, direction=self.direction)
        between = (2.0 * self.angle_deg,) * (self.arcs - 2)
        return alternating(first, (self.angle_deg, *between, self.angle_deg))


class StepSteer(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A straight that becomes an arc while driving: the step response of the steering."""

    turn: Turn
    straight_m: Length
    arc_m: Length
    radius_m: Radius | None = None
    axle_angle_deg: AxleAngle | None = None
    direction: Direction = "forward"

    def __post_init__(self) -> None:
        exactly_one(self, "radius_m", "axle_angle_deg")

    def segments(self) -> tuple[Segment, ...]:
        """Return the straight and the arc."""
        arc = Arc(
            turn=self.turn,
            radius_m=self.radius_m,
            axle_angle_deg=self.axle_angle_deg,
            length_m=self.arc_m,
            direction=self.direction,
        )
        return Straight(length_m=self.straight_m, direction=self.direction), arc


class SpeedSteps(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One speed after another, `step_s` each, on a straight, or on a circle where `radius_m` and `turn` are given."""

    speeds: Annotated[tuple[Speed, ...], Meta(min_length=1)]
    step_s: Duration
    turn: Turn | None = None
    radius_m: Radius | None = None
    direction: Direction = "forward"

    def __post_init__(self) -> None:
        for speed in self.speeds:
            check_speed(speed)
        if (self.turn is None) != (self.radius_m is None):
            raise ValueError("turn and radius_m go together: give both for a circle, or none for a straight")

    def segments(self) -> tuple[Segment, ...]:
        """Return one segment per speed."""
        return tuple(self._segment(speed) for speed in self.speeds)

    def _segment(self, speed: Speed) -> Segment:
        if self.turn is None:
            return Straight(duration_s=self.step_s, speed=speed, direction=self.direction)
        return Arc(
            turn=self.turn, radius_m=self.radius_m, duration_s=self.step_s, speed=speed, direction=self.direction
        )


class Endurance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Circles for a duration, as in the thesis' section 8.1."""

    turn: Turn
    radius_m: Radius
    duration_s: Duration
    direction: Direction = "forward"

    def segments(self) -> tuple[Segment, ...]:
        """Return one long arc."""
        return (Arc(turn=self.turn, radius_m=self.radius_m, duration_s=self.duration_s, direction=self.direction),)


Row = tuple[float, float, float, float]


MOST_ROWS = 8000
"""How many commands a run may have, a little less than a recorded run may that is driven again unseen."""


class CommandTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Raw commands: `rows` of t_s, drive, front, rear in the vehicle's own `unit`; the stop is at `duration_s`.

    The unit ``"channels"`` is that of each channel, for a vehicle whose channels have different ones.
    """

    unit: TableUnit
    duration_s: Duration
    rows: Annotated[tuple[Row, ...], Meta(min_length=1, max_length=MOST_ROWS)]

    def __post_init__(self) -> None:
        times = [row[0] for row in self.rows] + [self.duration_s]
        if times[0] != 0.0:
            raise ValueError(f"rows[0]: the first command is not at 0 s: {times[0]:g} s")
        for i, (before, after) in enumerate(pairwise(times), start=1):
            if not after > before:
                where = f"rows[{i}]" if i < len(self.rows) else "duration_s"
                raise ValueError(f"{where}: time does not increase: {after:g} s (limit: after {before:g} s)")
