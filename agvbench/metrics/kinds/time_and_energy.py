"""Time and energy of a run."""

from __future__ import annotations

import math

import numpy as np

from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import metric
from agvbench.types import Floats

_NEAR_M = 0.01
_POWER_W = "power_W"
_PAIRS = (("battery_V", "battery_A"), ("voltage_V", "current_A"))


@metric(unit="s", title="driving time", digits=2, margin=0.1)
def driving_time(run: MeasuredRun) -> float:
    """Time from the first command until the vehicle stays within 10 mm of where it ends."""
    driven = run.driven
    away = np.hypot(*(driven[:, 1:3] - np.median(driven[-_last(driven[:, 0]) :, 1:3], axis=0)).T) > _NEAR_M
    return float(driven[np.flatnonzero(away)[-1] + 1, 0]) if away.any() and not away[-1] else math.nan


def _last(t_s: Floats) -> int:
    """Return how many rows the last 0.5 s have."""
    return max(1, int(np.sum(t_s > t_s[-1] - 0.5)))


@metric(unit="J", title="energy", margin=0.0)
def energy(run: MeasuredRun) -> float:
    """Integral of the logged power (power_W, or battery_V × battery_A, or voltage_V × current_A) over the run."""
    if _POWER_W in run.logged:
        series = run.logged[_POWER_W]
        return _integral(series.t_s, series.value)
    for voltage, current in _PAIRS:
        if voltage in run.logged and current in run.logged:
            return _integral(run.logged[voltage].t_s, run.logged[voltage].value * run.logged[current].value)
    return math.nan


def _integral(t_s: Floats, value: Floats) -> float:
    counted = np.isfinite(value) & (t_s >= 0.0)
    return float(np.trapezoid(value[counted], t_s[counted])) if counted.sum() > 1 else math.nan
