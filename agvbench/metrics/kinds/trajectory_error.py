"""Absolute and relative trajectory error: driven poses against the planned ones at the same time.

Definitions after Sturm et al. 2012 (A benchmark for the evaluation of RGB-D SLAM systems, IROS), section IV, and the
program evo, which reads the TUM files that agvbench exports. Start poses coincide; nothing is aligned by a fit.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import metric
from agvbench.types import Floats

_APART_S = 1.0


@metric(unit="mm", title="absolute trajectory error", margin=5.0)
def absolute_trajectory_error(run: MeasuredRun) -> float:
    """Root mean square of the distances between driven and planned positions at the same time, start poses equal."""
    if run.planned is None:
        return math.nan
    driven = _while_planned(run.driven, run.planned)
    planned = _at(driven[:, 0], run.planned)
    return 1e3 * float(np.sqrt(np.mean(np.sum((driven[:, 1:3] - planned[:, 1:3]) ** 2, axis=1))))


@metric(unit="mm", title="relative trajectory error", margin=5.0)
def relative_trajectory_error(run: MeasuredRun) -> float:
    """Root mean square of the position error of the motion within 1 s, in the frame of its beginning."""
    if run.planned is None:
        return math.nan
    driven = _while_planned(run.driven, run.planned)
    begin = driven[driven[:, 0] <= driven[-1, 0] - _APART_S]
    if not len(begin):
        return math.nan
    after = _at(begin[:, 0] + _APART_S, driven)
    apart = _motion(begin, after) - _motion(_at(begin[:, 0], run.planned), _at(after[:, 0], run.planned))
    return 1e3 * float(np.sqrt(np.mean(np.abs(apart) ** 2)))


def _while_planned(driven: Floats, planned: Floats) -> Floats:
    """Return the driven poses up to the end of the plan: later ones have no planned pose of their time."""
    return np.asarray(driven[driven[:, 0] <= planned[-1, 0]])


def _at(t_s: Floats, poses: Floats) -> Floats:
    """Return poses (n, 4) at times `t_s`, linear between rows, at rest before the first and after the last."""
    return np.column_stack([t_s, *(np.interp(t_s, poses[:, 0], poses[:, k]) for k in (1, 2, 3))])


def _motion(begin: Floats, after: Floats) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Return the positions of `after` in the frames of `begin`, as complex numbers [m]."""
    moved = (after[:, 1] - begin[:, 1]) + 1j * (after[:, 2] - begin[:, 2])
    return np.asarray(moved * np.exp(-1j * begin[:, 3]))
