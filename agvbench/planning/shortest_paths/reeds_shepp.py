"""The shortest path of a vehicle that drives both ways and cannot turn tighter than a radius.

Reeds and Shepp (1990) show that one of 48 words is shortest. Eight base words are solved here for a vehicle at the
origin, each from the chain of its circles' centres; mirroring, exchanging forward and backward, and driving the path
from its end give the others. A word's lengths are signed (negative is backward), in radii. A solution drives to the
goal whatever its signs turn out to be, so none has to be rejected: the shortest of all is the answer.

In the formulas the plane is the complex plane: `u(h)` = exp(ih) is the unit vector along heading h, the left centre
of a pose is at +i u(h) and the right centre at −i u(h); `c` runs from the start's left centre to a centre of the goal.

References
----------
J. A. Reeds, L. A. Shepp, "Optimal paths for a car that goes both forwards and backwards", Pacific Journal of
Mathematics 145 (1990), 367-393.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.planning.shortest_paths.pieces import RESOLUTION, Piece, by_length, path_of, require_solvable
from agvbench.types import Floats, Pose

Complexes = NDArray[np.complex128]
_QUARTER = 0.5 * math.pi


class _Word(NamedTuple):
    letters: str
    solve: Callable[[Complexes, Floats], list[Floats]]
    also_reversed: bool = False


def _wrap(angle: Floats) -> Floats:
    return angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi))


def _to_left(goal: Complexes, heading: Floats) -> Complexes:
    return np.asarray(goal + 1j * np.exp(1j * heading) - 1j)


def _to_right(goal: Complexes, heading: Floats) -> Complexes:
    return np.asarray(goal - 1j * np.exp(1j * heading) - 1j)


def _lsl(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_left(goal, heading)
    course = np.where(abs(c) < RESOLUTION, heading, np.angle(c))
    return [course, abs(c), heading - course]


def _lsr(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_right(goal, heading)
    straight = np.sqrt(abs(c) ** 2 - 4.0)
    course = np.angle(c) + np.arctan2(2.0, straight)
    return [course, straight, course - heading]


def _lrl(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_left(goal, heading)
    half = np.arcsin(abs(c) / 4.0)
    first = np.angle(c) - half + math.pi
    return [first, -2.0 * half, heading - first - 2.0 * half]


def _lrlr_there_and_back(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_right(goal, heading)  # c = 2 (2 cos middle − 1) · (−i) u(first − middle)
    middle = np.arccos((2.0 + abs(c)) / 4.0)
    first = np.angle(c) + _QUARTER + middle
    return [first, middle, -middle, first - 2.0 * middle - heading]


def _lrlr_backward_between(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_right(goal, heading)  # |c|² = 4 (5 − 4 cos middle)
    middle = -np.arccos((20.0 - abs(c) ** 2) / 16.0)
    first = np.angle(c) + _QUARTER - np.arctan2(np.sin(middle), 2.0 - np.cos(middle))
    return [first, middle, middle, first - heading]


def _lrsl(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_left(goal, heading)  # c = (−2 − straight + 2i) u(course)
    straight = np.sqrt(abs(c) ** 2 - 4.0) - 2.0
    course = np.angle(c) - np.arctan2(2.0, -2.0 - straight)
    return [course - _QUARTER, np.full_like(course, -_QUARTER), -straight, heading - course]


def _lrsr(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_right(goal, heading)  # c = (−2 − straight) u(course)
    course = np.angle(c) + math.pi
    return [course - _QUARTER, np.full_like(course, -_QUARTER), np.asarray(2.0 - abs(c)), course - heading]


def _lrslr(goal: Complexes, heading: Floats) -> list[Floats]:
    c = _to_right(goal, heading)  # c = (−4 − straight + 2i) u(course)
    straight = np.sqrt(abs(c) ** 2 - 4.0) - 4.0
    course = np.angle(c) - np.arctan2(2.0, -4.0 - straight)
    quarter = np.full_like(course, -_QUARTER)
    return [course - _QUARTER, quarter, -straight, quarter, course - _QUARTER - heading]


_WORDS = (
    _Word("LSL", _lsl),
    _Word("LSR", _lsr),
    _Word("LRL", _lrl, also_reversed=True),
    _Word("LRLR", _lrlr_there_and_back),
    _Word("LRLR", _lrlr_backward_between),
    _Word("LRSL", _lrsl, also_reversed=True),
    _Word("LRSR", _lrsr, also_reversed=True),
    _Word("LRSLR", _lrslr),
)
_MIRROR = str.maketrans("LR", "RL")


def _solutions(goal: Complexes, heading: Floats) -> list[tuple[str, Floats]]:
    """Return (letters, signed lengths (pieces, n)) of every word under every symmetry."""
    found = []
    for word in _WORDS:
        for backwards in (False, True)[: 1 + word.also_reversed]:
            # Driven from its end, a path leads to the start as the mirrored goal sees it.
            seen = np.conj(goal) * np.exp(1j * heading) if backwards else goal
            for mirror, gear in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                x, y = gear * seen.real, mirror * seen.imag
                with np.errstate(invalid="ignore"):  # NaN: this word does not reach the goal
                    lengths = gear * np.stack(
                        word.solve(np.asarray(x + 1j * y, dtype=np.complex128), gear * mirror * heading)
                    )
                arcs = np.array([letter != "S" for letter in word.letters])
                lengths[arcs] = _wrap(lengths[arcs])
                letters = word.letters if mirror == 1 else word.letters.translate(_MIRROR)
                found.append((letters[::-1], lengths[::-1]) if backwards else (letters, lengths))
    return found


def _local(starts: Floats, goals: Floats, radius_m: float) -> tuple[Complexes, Floats]:
    delta = (goals - starts).T
    return (delta[0] + 1j * delta[1]) * np.exp(-1j * starts[:, 2]) / radius_m, delta[2]


def shortest_lengths(starts: Floats, goals: Floats, radius_m: float) -> Floats:
    """Return the lengths [m] of the shortest paths between poses `starts` and `goals` (n, 3), shape (n,)."""
    words = _solutions(*_local(starts, goals, radius_m))
    shortest = np.nanmin([abs(lengths).sum(axis=0) for _, lengths in words], axis=0)
    return np.asarray(radius_m * shortest, dtype=np.float64)


def shortest_path(start: Pose, goal: Pose, radius_m: float) -> tuple[Piece, ...]:
    """Return the shortest path from `start` to `goal`, driven forward and backward.

    Raises
    ------
    PlanError
        If the radius is not positive or a pose is not finite.

    Examples
    --------
    >>> [(p.side, p.backward) for p in shortest_path(Pose(0, 0, 0), Pose(-1, 0, 0), 0.5)]
    [('straight', True)]
    """
    return paths_by_length(start, goal, radius_m)[0]


def paths_by_length(start: Pose, goal: Pose, radius_m: float) -> list[tuple[Piece, ...]]:
    """Return every word's path from `start` to `goal`, the shortest first, for callers that the shortest does not suit.

    Raises
    ------
    PlanError
        If the radius is not positive or a pose is not finite.
    """
    require_solvable(start, goal, radius_m)
    words = _solutions(*_local(np.array([start]), np.array([goal]), radius_m))
    reaching = [(word, lengths[:, 0].tolist()) for word, lengths in words if np.isfinite(lengths).all()]
    return by_length([path_of(word, lengths, radius_m) for word, lengths in reaching], radius_m)
