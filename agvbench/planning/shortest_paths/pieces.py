"""Pieces of a path: arcs and straights of the marker centroid, driven forward or backward.

A path is a sequence of pieces; it is geometry alone, and knows neither vehicle nor time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from agvbench.errors import PlanError
from agvbench.types import Pose, wrap_angle

Side = Literal["left", "straight", "right"]
# Lengths below this many radii are rounding errors: such a piece is left out, and paths that differ by less are equally
# long.
RESOLUTION = 1e-9
_SIDES: dict[str, Side] = {"L": "left", "S": "straight", "R": "right"}
_SIGN = {"left": 1, "straight": 0, "right": -1}
_MIRRORED: dict[Side, Side] = {"left": "right", "straight": "straight", "right": "left"}


@dataclass(frozen=True)
class Piece:
    """One piece of a path, of constant curvature.

    Parameters
    ----------
    side
        The side of the vehicle on which the centre of the turn lies.
    length_m
        Length along the path [m], never negative.
    radius_m
        Radius [m]; infinite for a straight.
    backward
        Whether it is driven backward.
    """

    side: Side
    length_m: float
    radius_m: float = math.inf
    backward: bool = False

    @property
    def turn_rad(self) -> float:
        """The change of heading [rad], counter-clockwise."""
        turn = _SIGN[self.side] * self.length_m / self.radius_m
        return -turn if self.backward else turn

    def end(self, start: Pose) -> Pose:
        """Return the pose at the end of the piece.

        >>> Piece("left", math.pi / 2, radius_m=1.0, backward=True).end(Pose(0.0, 0.0, 0.0)).x_m
        -1.0
        """
        turn = self.turn_rad
        along = -self.length_m if self.backward else self.length_m
        # The chord form holds for straights, too, and loses no digits where the turn is slight.
        half = 0.5 * turn
        chord = along * (math.sin(half) / half if half else 1.0)
        direction = start.heading_rad + half
        return Pose(
            start.x_m + chord * math.cos(direction),
            start.y_m + chord * math.sin(direction),
            wrap_angle(start.heading_rad + turn),
        )

    def mirrored(self) -> Piece:
        """Return the piece with left and right exchanged."""
        return replace(self, side=_MIRRORED[self.side])

    def reversed_gear(self) -> Piece:
        """Return the piece with forward and backward exchanged."""
        return replace(self, backward=not self.backward)


def length_of(pieces: Iterable[Piece]) -> float:
    """Return the length of a path [m]."""
    return math.fsum(piece.length_m for piece in pieces)


def path_of(word: str, lengths: Iterable[float], radius_m: float) -> tuple[Piece, ...]:
    """Return the path of a word such as ``LSR`` with signed lengths [radii], negative where it is driven backward."""
    return tuple(
        Piece(_SIDES[letter], abs(length) * radius_m, math.inf if letter == "S" else radius_m, backward=length < 0.0)
        for letter, length in zip(word, lengths, strict=True)
        if abs(length) > RESOLUTION
    )


def by_length(paths: Sequence[tuple[Piece, ...]], radius_m: float) -> list[tuple[Piece, ...]]:
    """Return the paths, the shortest first; of those that are equally long within rounding, the one of fewest pieces.

    Near a straight several words of small arcs are as long as the straight to the last digits.
    """
    tie_m = min(map(length_of, paths)) + RESOLUTION * radius_m
    return sorted(paths, key=lambda path: (max(length_of(path), tie_m), len(path)))


def require_solvable(start: Pose, goal: Pose, radius_m: float) -> None:
    """Raise `PlanError` if the turning radius is not positive or a pose is not finite."""
    if not (radius_m > 0.0 and math.isfinite(radius_m)):
        raise PlanError("turning radius is not a positive number", value=f"{radius_m} m")
    if not (start.is_finite and goal.is_finite):
        raise PlanError("a pose to drive between is not finite", value=start if goal.is_finite else goal)
