"""What a drive command is worth once speed has settled, straight ahead, in one session: taken out of free driving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.map_fit import r_squared, rounded
from agvbench.errors import FitError
from agvbench.types import Floats
from agvbench.vehicle.maps import DeadBandWithSaturation, MonotoneTable, StaticMap

_MIN_WINDOWS = 20
_SLOWEST_LAG_S = 3.0
_LARGEST_LOSS = 2.0
_NOTEWORTHY = 0.05
_TURNED_MOST = 0.95
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

    ``map`` of the drive in the session with the most windows; ``lag_s``; ``loss`` in turns; ``session_scale``;
    ``r_squared`` of the windows' speeds; ``settled_mps`` of each window, with lag, turn and session taken out;
    ``stderr`` of lag and loss; ``words`` to tell.
    """

    map: StaticMap
    lag_s: float
    loss: float
    session_scale: dict[str, float]
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
    from scipy.optimize import least_squares

    offset = data.command - neutral
    sides = [side for sign in (-1.0, 1.0) if (side := _side(sign, offset)) is not None]
    if not sides:
        raise FitError("too few windows of free driving away from neutral", where="drive", limit=f"{_MIN_WINDOWS}")
    sessions, session = np.unique(data.session, return_inverse=True)
    reference = int(np.argmax(np.bincount(session)))
    others = np.flatnonzero(np.arange(len(sessions)) != reference)
    quick = float(np.quantile(np.abs(data.speed_mps), 0.9))

    def settled_ahead(p: Floats) -> Floats:
        """Return f(u): edges and gains follow lag, loss and the sessions' scales in `p`."""
        value = np.zeros(len(offset))
        for k, side in enumerate(sides):
            edge, gain = p[2 + len(others) + 2 * k :][:2]
            value += quick * gain * np.maximum(side.sign * offset / side.farthest - edge, 0.0)
        return value

    def predicted(p: Floats) -> Floats:
        scale = np.ones(len(sessions))
        scale[others] = p[2 : 2 + len(others)]
        turned = np.maximum(1.0 - p[1] * data.turned, 1.0 - _TURNED_MOST)
        return np.asarray(scale[session] * settled_ahead(p) * turned - p[0] * data.acceleration_mps2)

    def misfit(p: Floats) -> Floats:
        return (predicted(p) - data.speed_mps) / quick

    low = [0.0, 0.0, *[0.05] * len(others)]
    high = [_SLOWEST_LAG_S, _LARGEST_LOSS, *[20.0] * len(others)]
    for side in sides:
        low, high = [*low, 0.0, -100.0], [*high, 0.98 * side.lowest / side.farthest, 100.0]
    solutions = []
    for share in (0.05, 0.5, 0.95):
        start = [0.3, 0.3, *[1.0] * len(others)]
        for k, side in enumerate(sides):
            edge = share * high[2 + len(others) + 2 * k]
            driven = side.sign * offset > 0.0
            start += [edge, float(np.sign(np.median(data.speed_mps[driven]))) / (1.0 - edge)]
        solutions.append(least_squares(misfit, start, bounds=(low, high), loss="soft_l1", f_scale=0.05))
    best = min(solutions, key=lambda solution: float(solution.cost))
    p = np.asarray(best.x, dtype=np.float64)
    scale = np.ones(len(sessions))
    scale[others] = p[2 : 2 + len(others)]
    left = np.maximum(1.0 - p[1] * data.turned, 1.0 - _TURNED_MOST)
    jacobian = np.asarray(best.jac, dtype=np.float64)
    spread = 1.4826 * float(np.median(np.abs(misfit(p))))
    errors = spread * np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
    ramps = [
        (side, float(p[2 + len(others) + 2 * k]), quick * float(p[3 + len(others) + 2 * k]))
        for k, side in enumerate(sides)
    ]
    named = dict(zip(sessions.tolist(), scale.tolist(), strict=True))
    share_explained = r_squared(data.speed_mps, data.speed_mps - predicted(p))
    return DriveRegression(
        map=_ramp_map(ramps, neutral),
        lag_s=float(p[0]),
        loss=float(p[1]),
        session_scale=named,
        r_squared=share_explained,
        settled_mps=(data.speed_mps + p[0] * data.acceleration_mps2) / left / scale[session],
        stderr={"lag_s": float(errors[0]), "loss": float(errors[1])},
        words=_words(p, ramps, named, str(sessions[reference]), share_explained, neutral),
    )


def _side(sign: float, offset: Floats) -> _Side | None:
    here = sign * offset[sign * offset > 0.0]
    if len(here) < _MIN_WINDOWS:
        return None
    return _Side(sign, float(np.quantile(here, 0.02)), float(here.max()), len(here))


def _ramp_map(ramps: list[tuple[_Side, float, float]], neutral: float) -> StaticMap:
    """Return the ramps as a map: up to the farthest command seen, and nothing on a side that was not driven."""
    if len(ramps) == 2:
        (below, below_edge, below_gain), (above, above_edge, above_gain) = ramps
        full = below_gain * (1.0 - below_edge), above_gain * (1.0 - above_edge)
        if full[0] * full[1] < 0.0:
            return DeadBandWithSaturation(
                low_saturation=rounded(neutral - below.farthest),
                low_edge=rounded(neutral - below_edge * below.farthest),
                high_edge=rounded(neutral + above_edge * above.farthest),
                high_saturation=rounded(neutral + above.farthest),
                low_output=rounded(full[0]),
                high_output=rounded(full[1]),
            )
    side, edge, gain = max(ramps, key=lambda ramp: ramp[0].windows)
    knots = {neutral: 0.0}
    if edge > _NO_EDGE:
        knots[neutral + side.sign * edge * side.farthest] = 0.0
    knots[neutral + side.sign * side.farthest] = gain * (1.0 - edge)
    commands = sorted(knots)
    return MonotoneTable(tuple(map(rounded, commands)), tuple(rounded(knots[c]) for c in commands), "linear")


def _words(
    p: Floats,
    ramps: list[tuple[_Side, float, float]],
    scale: dict[str, float],
    reference: str,
    explained: float,
    neutral: float,
) -> list[str]:
    lag, loss = float(p[0]), float(p[1])
    explains = f"a ramp explains {explained:.0%} of the speeds' variance"
    nuisance = f"a lag of {lag:.2f} s and a loss of {loss:.2f} (|tan δf| + |tan δr|) in turns"
    words = [f"{explains}, with {nuisance}, both taken out of the map"]
    for side, edge, _ in ramps:
        at = neutral + side.sign * edge * side.farthest
        if edge < _NO_EDGE:
            words.append(f"no dead band shows {'above' if side.sign > 0 else 'below'} neutral")
        elif edge * side.farthest > 0.97 * side.lowest:
            words.append(f"the dead band may be anything from {neutral:g} to {at:.3g}: nothing slower was driven")
    apart = [f"{name} {s:.2f}" for name, s in scale.items() if abs(s - 1.0) > _NOTEWORTHY]
    if apart:
        words.append(
            f"one command gives other speeds in other sessions ({', '.join(apart)} times that of {reference}, "
            "for which the map holds); --session calibrates each by itself"
        )
    return words
