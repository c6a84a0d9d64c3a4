"""Repeatability and reproducibility of residuals: standard deviations of repeats, in the terms of ISO 5725."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.residuals.residuals import MEDIAN, QUANTITIES, UNITS, PoseResiduals
from agvbench.types import Floats

_MAX_RATIO = 4.0
"""A group's standard deviation is limited to this multiple of the median: a bad run has little influence."""

Groups = list[NDArray[np.int64]]
Deviations = Callable[[Floats], Floats]


def repeatability(residuals: PoseResiduals, group: NDArray[np.int64], started_h: Floats) -> dict[str, float] | None:
    """Return the root mean square between repeats driven in succession; None without repeats.

    It is estimated from the differences between successive repeats (von Neumann 1941), so that a change during the
    campaign hardly enters. Compare it with `PoseResiduals.rms`.

    The residuals are those of the *final* model. With raw poses, the effect of a cause that depends on place or time
    would count as a difference between repeats. `MEDIAN` is the median over runs of the distance of the end positions.

    Parameters
    ----------
    residuals
        The residuals of R runs.
    group
        (R,): the same number for runs with the same commands in the same session.
    started_h
        (R,): when each run began [h].
    """
    ordered = [own[np.argsort(started_h[own], kind="stable")] for own in groups_of_repeats(group)]
    return _root_mean_squares(residuals, ordered, _successive)


def reproducibility(residuals: PoseResiduals, group: NDArray[np.int64]) -> dict[str, float] | None:
    """Return the root mean square between all repeats of the campaign; None without repeats.

    It contains what changes during an evening and between sessions. ISO 5725-3 calls it intermediate precision, since
    laboratory and vehicle are the same.
    """
    return _root_mean_squares(residuals, groups_of_repeats(group), _from_mean)


def groups_of_repeats(group: NDArray[np.int64]) -> Groups:
    """Return the runs of each group with at least two."""
    return [own for g in np.unique(group) if len(own := np.flatnonzero(group == g)) > 1]


def _from_mean(values: Floats) -> Floats:
    """Return deviations of repeats (n, …) from their mean, whose mean square is the variance."""
    return np.asarray((values - values.mean(axis=0)) * np.sqrt(len(values) / (len(values) - 1.0)))


def _successive(values: Floats) -> Floats:
    """Return differences of successive repeats (n, …), (n − 1, …), whose mean square is the variance."""
    return np.asarray(np.diff(values, axis=0) / np.sqrt(2.0))


def _root_mean_squares(residuals: PoseResiduals, groups: Groups, deviations: Deviations) -> dict[str, float] | None:
    """Return the root mean square of each quantity's deviations over groups, weighted by their runs."""
    if not groups:
        return None
    squares = [_mean_squares(residuals, own, deviations) for own in groups]
    runs = np.array([len(own) for own in groups])
    out = {}
    for name in QUANTITIES:
        value = np.array([one[name] for one in squares])
        value = np.minimum(value, _MAX_RATIO**2 * np.median(value))
        out[name] = UNITS[name] * float(np.sqrt(np.sum(value * runs) / np.sum(runs)))
    distances = np.concatenate([np.hypot(*deviations(residuals.ends[own, :2]).T) for own in groups])
    return out | {MEDIAN: 1e3 * float(np.median(distances))}


def _mean_squares(residuals: PoseResiduals, own: NDArray[np.int64], deviations: Deviations) -> dict[str, float]:
    """Return the mean square of each quantity's deviations in a group of repeats."""
    both = residuals.seen[own].all(axis=0)
    path = deviations(residuals.path[own][:, both]) if both.any() else np.zeros((1, 1, 3))
    along, across = np.mean(deviations(residuals.ends[own, :2]) ** 2, axis=0).tolist()
    return {
        "end_position_mm": along + across,
        "along_mm": along,
        "across_mm": across,
        "delta_heading_deg": float(np.mean(deviations(residuals.delta_heading_rad[own]) ** 2)),
        "delta_s_mm": float(np.mean(deviations(residuals.delta_s_m[own]) ** 2)),
        "position_rms_mm": float(np.mean(np.sum(path[..., :2] ** 2, axis=-1))),
        "heading_rms_deg": float(np.mean(path[..., 2] ** 2)),
    }
