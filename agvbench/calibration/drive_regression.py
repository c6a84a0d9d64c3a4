"""What a drive command is worth once speed has settled, straight ahead, in one session: taken out of free driving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.maps.map_fit import r_squared, rounded
from agvbench.errors import FitError
from agvbench.signals import robust_std
from agvbench.types import Floats
from agvbench.vehicle.maps import DeadBandWithSaturation, MonotoneTable, StaticMap

_MIN_WINDOWS = 20
_SLOWEST_LAG_S = 3.0
_LARGEST_LOSS = 2.0
_NOTEWORTHY = 0.05
_TURNED_MOST = 0.95
_OUTLYING = 0.05  # of a quick speed: beyond it a window counts less
_MOST_EDGE = 0.98
_NO_EDGE = 1e-3  # of the farthest command


@dataclass(frozen=True)
class DriveData:
    """Windows in motion, arrays of shape (n,).

    ``command``; ``speed_mps`` and ``acceleration_mps2`` along the wheels; ``turned`` = |tan δf| + |tan δr|;
    ``session``.
    """

    command: Floats
    speed_mps: Floats
    acceleration_mps2: Floats
    turned: Floats
    session: NDArray[np.str_]


@dataclass(frozen=True)
class DriveRegression:
    """What was found.

    ``map`` of the drive in the session with the most windows; ``r_squared`` of the windows' speeds; ``settled_mps`` of
    each window, with lag, turn and session taken out; ``stderr`` of lag and loss; ``words`` for people.
    """

    map: StaticMap
    r_squared: float
    settled_mps: Floats
    stderr: dict[str, float]
    words: list[str]


@dataclass(frozen=True)
class _Side:
    """One side of neutral: ±1, and the commands that were seen there, as distances from neutral."""

    sign: float
    lowest: float
    farthest: float
    windows: int


def regress_drive(data: DriveData, neutral: float) -> DriveRegression:
    """Explain the speed of every window by its command, a first-order lag, turning and its session.

    ::

        v + T·v̇ = s · f(u) · (1 − loss · (|tan δf| + |tan δr|))

    with f a ramp from the edge of a dead band on each side of neutral, s = 1 in the session with the most windows and
    free in the others: robust least squares (soft L1). A free value for each command would fit better and mean less:
    a driver holding the speed gives more command where less comes of it, so that within such a drive speed does not
    rise with the command at all. The ramp is what standing at neutral, starts and different speeds agree on. Lag and
    loss are only there to read f; as effects they are judged elsewhere.

    Raises
    ------
    FitError
        If no side of neutral was driven.
    """
    problem = _RegressionProblem.of(data, neutral)
    p, errors = problem.solve()
    _, _, scale = problem.unpack(p)
    explained = r_squared(data.speed_mps, data.speed_mps - problem.predicted(p))
    named = dict(zip(problem.sessions, scale.tolist(), strict=True))
    reference = problem.sessions[problem.reference]
    ramps = [
        _Ramp(side, float(edge) * side.farthest, problem.quick_mps * float(gain) / side.farthest)
        for side, (edge, gain) in zip(problem.sides, problem.ramps(p), strict=True)
    ]
    return DriveRegression(
        map=_ramp_map(ramps, neutral),
        r_squared=explained,
        settled_mps=(data.speed_mps + p[0] * data.acceleration_mps2) / problem.left(p) / scale[problem.session],
        stderr={"lag_s": float(errors[0]), "loss": float(errors[1])},
        words=_words(p, ramps, named, reference, explained, neutral),
    )


@dataclass(frozen=True)
class _Ramp:
    """A side's ramp: distance of its edge from neutral, and slope beyond it [m/s per command unit], signed."""

    side: _Side
    edge: float
    slope: float

    @property
    def full_mps(self) -> float:
        return self.slope * (self.side.farthest - self.edge)


@dataclass(frozen=True)
class _RegressionProblem:
    """The least-squares problem: parameters are lag, loss, a scale per other session, edge and gain per side.

    Edges are shares of the farthest command of their side, gains of the speed `quick_mps` there.
    """

    data: DriveData
    offset: Floats
    sides: list[_Side]
    sessions: list[str]
    session: NDArray[np.int64]
    reference: int
    quick_mps: float

    @classmethod
    def of(cls, data: DriveData, neutral: float) -> _RegressionProblem:
        offset = data.command - neutral
        sides = [side for sign in (-1.0, 1.0) if (side := _side(sign, offset)) is not None]
        if not sides:
            limit = f"at least {_MIN_WINDOWS}"
            raise FitError("too few windows of free driving away from neutral", where="drive", limit=limit)
        sessions, session = np.unique(data.session, return_inverse=True)
        reference = int(np.argmax(np.bincount(session)))
        quick = float(np.quantile(np.abs(data.speed_mps), 0.9))
        return cls(data, offset, sides, sessions.tolist(), session, reference, quick)

    def unpack(self, p: Floats) -> tuple[float, float, Floats]:
        """Return lag, loss and the scale of every session."""
        scale = np.insert(p[2 : 1 + len(self.sessions)], self.reference, 1.0)
        return float(p[0]), float(p[1]), scale

    def ramps(self, p: Floats) -> Floats:
        """Return edge and gain of each side, shape (sides, 2)."""
        return np.reshape(p[1 + len(self.sessions) :], (-1, 2))

    def left(self, p: Floats) -> Floats:
        """Return the share of speed that turning leaves."""
        return np.asarray(np.maximum(1.0 - p[1] * self.data.turned, 1.0 - _TURNED_MOST), dtype=np.float64)

    def predicted(self, p: Floats) -> Floats:
        """Return the speed of every window."""
        lag, _, scale = self.unpack(p)
        ahead = np.zeros(len(self.offset))
        for side, (edge, gain) in zip(self.sides, self.ramps(p), strict=True):
            ahead += self.quick_mps * gain * np.maximum(side.sign * self.offset / side.farthest - edge, 0.0)
        return np.asarray(scale[self.session] * ahead * self.left(p) - lag * self.data.acceleration_mps2)

    def solve(self) -> tuple[Floats, Floats]:
        """Return the parameters and their standard errors, best of three starts that differ in the dead band."""
        from scipy.optimize import least_squares

        def misfit(p: Floats) -> Floats:
            return (self.predicted(p) - self.data.speed_mps) / self.quick_mps

        bounds = self._bounds()
        solutions = [
            least_squares(misfit, self._start(share), bounds=bounds, loss="soft_l1", f_scale=_OUTLYING)
            for share in (0.05, 0.5, 0.95)
        ]
        best = min(solutions, key=lambda solution: float(solution.cost))
        p, jacobian = np.asarray(best.x, dtype=np.float64), np.asarray(best.jac, dtype=np.float64)
        sd = robust_std(misfit(p))
        errors = sd * np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
        return p, np.asarray(errors, dtype=np.float64)

    def _bounds(self) -> tuple[list[float], list[float]]:
        others = len(self.sessions) - 1
        low, high = [0.0, 0.0, *[0.05] * others], [_SLOWEST_LAG_S, _LARGEST_LOSS, *[20.0] * others]
        for side in self.sides:  # the dead band ends before the least command that moved the vehicle
            low, high = [*low, 0.0, -100.0], [*high, _MOST_EDGE * side.lowest / side.farthest, 100.0]
        return low, high

    def _start(self, share: float) -> list[float]:
        start = [0.3, 0.3, *[1.0] * (len(self.sessions) - 1)]
        for side in self.sides:
            edge = share * _MOST_EDGE * side.lowest / side.farthest
            driven = side.sign * self.offset > 0.0
            start += [edge, float(np.sign(np.median(self.data.speed_mps[driven]))) / (1.0 - edge)]
        return start


def _side(sign: float, offset: Floats) -> _Side | None:
    here = sign * offset[sign * offset > 0.0]
    if len(here) < _MIN_WINDOWS:
        return None
    return _Side(sign, float(np.quantile(here, 0.02)), float(here.max()), len(here))


def _ramp_map(ramps: list[_Ramp], neutral: float) -> StaticMap:
    """Return the ramps as a map: up to the farthest command seen, and nothing on a side that was not driven."""
    if len(ramps) == 2 and ramps[0].full_mps * ramps[1].full_mps < 0.0:
        below, above = ramps
        return DeadBandWithSaturation(
            low_saturation=rounded(neutral - below.side.farthest),
            low_edge=rounded(neutral - below.edge),
            high_edge=rounded(neutral + above.edge),
            high_saturation=rounded(neutral + above.side.farthest),
            low_output=rounded(below.full_mps),
            high_output=rounded(above.full_mps),
        )
    ramp = max(ramps, key=lambda ramp: ramp.side.windows)
    knots = {neutral: 0.0, neutral + ramp.side.sign * ramp.side.farthest: ramp.full_mps}
    if ramp.edge > _NO_EDGE * ramp.side.farthest:
        knots[neutral + ramp.side.sign * ramp.edge] = 0.0
    commands = sorted(knots)
    return MonotoneTable(tuple(map(rounded, commands)), tuple(rounded(knots[c]) for c in commands), "linear")


def _words(
    p: Floats, ramps: list[_Ramp], scale: dict[str, float], reference: str, explained: float, neutral: float
) -> list[str]:
    lag, loss = float(p[0]), float(p[1])
    explains = f"a ramp explains {explained:.0%} of the speeds' variance"
    nuisance = f"a lag of {lag:.2f} s and a loss of {loss:.2f} (|tan δf| + |tan δr|) in turns"
    words = [f"{explains}, with {nuisance}, both taken out of the map"]
    for ramp in ramps:
        side = "above" if ramp.side.sign > 0.0 else "below"
        if ramp.edge <= _NO_EDGE * ramp.side.farthest:
            words.append(f"no dead band shows {side} neutral")
        elif ramp.edge >= 0.99 * _MOST_EDGE * ramp.side.lowest:
            at = neutral + ramp.side.sign * ramp.edge
            words.append(f"the dead band {side} neutral may end before {at:.3g}: nothing slower was driven")
    apart = [f"{name} {s:.2f}" for name, s in scale.items() if abs(s - 1.0) > _NOTEWORTHY]
    if apart:
        words.append(
            f"one command gives other speeds in other sessions ({', '.join(apart)} times that of {reference}, "
            "for which the map holds); --session calibrates each by itself"
        )
    return words
