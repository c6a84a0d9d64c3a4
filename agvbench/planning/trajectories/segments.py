"""The segments that every trajectory is made of (straights, arcs, pauses), and how a trajectory gives its speed.

A speed is what the *drive command* sets, that of the axles. The centroid's follows from the steering angles (thesis
eq. 5.6), a little slower in turns. So a trajectory with one speed has one drive command, and a change of steering
is a change of steering only.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from agvbench.errors import PlanError
from agvbench.planning.shortest_paths.pieces import Piece

Length = Annotated[float, Meta(gt=0.0, le=10_000.0)]
Radius = Annotated[float, Meta(gt=0.0, le=10_000.0)]
Duration = Annotated[float, Meta(gt=0.0, le=360_000.0)]
TurnAngle = Annotated[float, Meta(gt=0.0, le=36_000.0)]
AxleAngle = Annotated[float, Meta(gt=0.0, lt=90.0)]
CrabAngle = Annotated[float, Meta(gt=-90.0, lt=90.0)]

Direction = Literal["forward", "backward"]
Turn = Literal["left", "right"]
Steering = Literal["abeam", "front", "rear", "opposite", "crab"]


def exactly_one(struct: Struct, *keys: str) -> None:
    """Raise ValueError unless exactly one of `keys` is given."""
    given = [key for key in keys if getattr(struct, key) is not None]
    if len(given) != 1:
        raise ValueError(f"exactly one is needed of {', '.join(keys)}: {', '.join(given) or 'none'} given")


class Straight(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="straight", tag_field="kind"):
    """A straight: the heading stays; with crab steering the vehicle moves at `crab_deg` to its heading."""

    length_m: Length | None = None
    duration_s: Duration | None = None
    direction: Direction = "forward"
    speed: Speed | None = None
    steering: Steering | None = None
    crab_deg: CrabAngle = 0.0

    def __post_init__(self) -> None:
        exactly_one(self, "length_m", "duration_s")
        if self.speed is not None:
            check_speed(self.speed)


class Arc(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="arc", tag_field="kind"):
    """An arc of the marker centroid about a centre on its left or right.

    `radius_m` is the centroid's in every steering mode; `axle_angle_deg` is the steered axle's angle, the front
    one's where both steer. `angle_deg` is the change of heading, without sign.
    """

    turn: Turn
    radius_m: Radius | None = None
    axle_angle_deg: AxleAngle | None = None
    angle_deg: TurnAngle | None = None
    length_m: Length | None = None
    duration_s: Duration | None = None
    direction: Direction = "forward"
    speed: Speed | None = None
    steering: Steering | None = None

    def __post_init__(self) -> None:
        exactly_one(self, "radius_m", "axle_angle_deg")
        exactly_one(self, "angle_deg", "length_m", "duration_s")
        if self.speed is not None:
            check_speed(self.speed)
        if self.steering == "crab":
            raise ValueError("crab steering cannot turn; use a straight with crab_deg")


class Pause(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="pause", tag_field="kind"):
    """Stand still for a while, the drive at neutral and the steering as it was."""

    duration_s: Duration


class SpotTurn(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="spot_turn", tag_field="kind"):
    """A turn on the spot about the middle of the axle of a differential vehicle, which alone can drive it.

    `yaw_rate` is ``"full"``, ``"half"``, a share such as ``"75%"``, or rad/s; `angle_deg` is without sign.
    """

    turn: Turn
    angle_deg: TurnAngle | None = None
    duration_s: Duration | None = None
    yaw_rate: Speed = "full"

    def __post_init__(self) -> None:
        exactly_one(self, "angle_deg", "duration_s")
        check_speed(self.yaw_rate, "yaw_rate", "rad/s", "turn to the other side")


Segment = Straight | Arc | SpotTurn | Pause


def from_pieces(pieces: tuple[Piece, ...]) -> tuple[Segment, ...]:
    """Return the segments that drive a path."""
    return tuple(_from_piece(piece) for piece in pieces)


def _from_piece(piece: Piece) -> Segment:
    direction: Direction = "backward" if piece.backward else "forward"
    if piece.side == "straight":
        return Straight(length_m=piece.length_m, direction=direction)
    return Arc(turn=piece.side, radius_m=piece.radius_m, length_m=piece.length_m, direction=direction)


def opposite(turn: Turn) -> Turn:
    """Return the other side."""
    return "right" if turn == "left" else "left"


def alternating(first: Arc, angles_deg: tuple[float, ...]) -> tuple[Segment, ...]:
    """Return arcs like `first` through `angles_deg`, to one side and the other in turn."""
    turns = (first.turn, opposite(first.turn))
    return tuple(
        msgspec.structs.replace(first, turn=turns[i % 2], angle_deg=angle) for i, angle in enumerate(angles_deg)
    )


Speed = float | str
_SHARES = {"full": 1.0, "half": 0.5}
_PER_CENT = re.compile(r"(\d+(?:\.\d+)?)\s*%")


def share_of(speed: str) -> float | None:
    """Return the share of full speed that `speed` names, or None if it names none.

    >>> share_of("half"), share_of("75%"), share_of("slow")
    (0.5, 0.75, None)
    """
    if speed in _SHARES:
        return _SHARES[speed]
    match = _PER_CENT.fullmatch(speed)
    share = float(match[1]) / 100.0 if match else 0.0
    return share if 0.0 < share <= 1.0 else None


def check_speed(
    speed: Speed,
    what: str = "speed",
    unit: str = "m/s",
    otherwise: str = 'to drive backward say direction = "backward"',
) -> None:
    """Raise ValueError, with a line for the user, unless `speed` is one."""
    if isinstance(speed, str):
        if share_of(speed) is None:
            raise ValueError(
                f"{what} is not a {what.replace('_', ' ')}: {speed!r} "
                f'(limit: "full", "half", a share "1%" to "100%", or {unit})'
            )
    elif not (math.isfinite(speed) and speed > 0.0):
        raise ValueError(f"{what} is not above zero: {speed} {unit}; {otherwise}")


def share_of_full(text: str, full: float, what: str, whose: str, unit: str, *, where: str) -> float:
    """Return the share of `full` that `text` names; raise `PlanError` if no one knows how much full is."""
    if not math.isfinite(full):
        raise PlanError(
            f"what {text} {what} is is not known: {whose} has no end", where=where, remedy=f"say it in {unit}"
        )
    share = share_of(text)
    assert share is not None  # noqa: S101 - checked when the trajectory was read
    return share * full


def axle_speed(speed: Speed, full_mps: float, *, where: str) -> float:
    """Return the axle speed [m/s, positive] that `speed` means for a vehicle whose full speed is `full_mps`.

    Raise `PlanError` if the vehicle does not go so fast, or no one knows how fast it goes.
    """
    if isinstance(speed, str):
        return share_of_full(speed, full_mps, "speed", "the drive's map", "m/s", where=where)
    if speed > full_mps * (1.0 + 1e-9):
        raise PlanError(
            "speed is more than the drive reaches",
            where=where,
            value=f"{speed:g} m/s",
            limit=f"{full_mps:.3f} m/s",
            remedy='slow down, or say "full"',
        )
    return min(speed, full_mps)
