"""Repeatability (spread) apart from accuracy (bias)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from agvbench.signals import robust_std
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.intervals import CONFIDENCE, Interval, median_interval
from agvbench.statistics.quantities import COMPONENTS, DISTANCE, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

FEWEST = 5


@dataclass(frozen=True)
class Spread:
    """Dispersion of repeats: standard deviation with its interval, and the robust one from the MAD."""

    sd: Interval
    robust_sd: float


def spread(values: Floats) -> Spread:
    """Return the dispersion of `values`, shape (n,), with Bonett's (2006) interval of the standard deviation.

    Bonett's interval uses the sample's own kurtosis where the chi-square interval assumes a normal distribution.
    Fewer than five values give NaN bounds.

    >>> dispersion = spread(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    >>> round(dispersion.sd.estimate, 3), round(dispersion.robust_sd, 3)
    (1.871, 2.224)
    """
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
    robust = robust_std(values - np.median(values))
    return Spread(Interval(sd, *_bonett(values, sd)), robust)


def bias_and_spread(errors: pd.DataFrame) -> pd.DataFrame:
    """Return accuracy and repeatability per trajectory, condition and component of the signed errors.

    Columns ``trajectory``, ``condition``, ``component``, ``repeats``, ``bias`` (median of the signed error) with
    ``bias_low`` and ``bias_high``, ``sd`` with ``sd_low`` and ``sd_high``, ``robust_sd``; 95 % intervals.
    """
    import pandas as pd

    return pd.DataFrame(
        {"trajectory": trajectory, "condition": condition, **_component(groups.get_group((condition,)), quantity)}
        for trajectory, runs in valid(errors).groupby("trajectory", sort=False)
        for groups in [runs.groupby(["condition"])]
        for condition in in_order(runs["condition"])
        for quantity in (*COMPONENTS, DISTANCE)
    )


def _component(group: pd.DataFrame, quantity: Quantity) -> dict[str, object]:
    values = group[quantity.column].to_numpy(dtype=float)
    bias, dispersion = median_interval(values), spread(values)
    return {
        "component": f"{quantity.symbol} [{quantity.unit}]",
        "repeats": len(values),
        **dict(zip(("bias", "bias_low", "bias_high"), bias, strict=True)),
        **dict(zip(("sd", "sd_low", "sd_high"), dispersion.sd, strict=True)),
        "robust_sd": dispersion.robust_sd,
    }


def _bonett(values: Floats, sd: float) -> tuple[float, float]:
    n = len(values)
    if n < FEWEST or sd == 0.0:
        return math.nan, math.nan
    z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2.0)
    middle = _trimmed_mean(values, 1.0 / (2.0 * math.sqrt(n - 4.0)))
    squares = float(np.sum((values - values.mean()) ** 2))
    kurtosis = n * float(np.sum((values - middle) ** 4)) / squares**2
    c = n / (n - z)
    stderr = c * math.sqrt(max(0.0, kurtosis - (n - 3.0) / n) / (n - 1.0))
    return (
        math.exp(0.5 * (math.log(c * sd**2) - z * stderr)),
        math.exp(0.5 * (math.log(c * sd**2) + z * stderr)),
    )


def _trimmed_mean(values: Floats, share: float) -> float:
    cut = min(int(share * len(values)), (len(values) - 1) // 2)
    return float(np.sort(values)[cut : len(values) - cut].mean())
