"""The segments that every trajectory is made of: straights, arcs and pauses, as users write them in TOML."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from agvbench.planning.paths import Piece
from agvbench.planning.speeds import Speed, check_speed

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


Segment = Straight | Arc | Pause


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
