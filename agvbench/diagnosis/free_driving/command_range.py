"""The range of commands of the training windows, and the test windows beyond it, where a model extrapolates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.measurement.windows import held_command
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES
from agvbench.types import Command, Floats

_TOLERANCE = 0.05


@dataclass(frozen=True)
class CommandRange:
    """The smallest and the largest command of a channel but neutral, in its own unit.

    ``training``: of the training windows. ``test``: of the test windows.
    """

    training: tuple[float, float]
    test: tuple[float, float]

    def to_table(self) -> dict[str, list[float]]:
        """Return the content for the diagnosis' JSON."""
        return {"training": list(self.training), "test": list(self.test)}


def command_ranges(training: Readings, test: Readings, neutral: Command) -> dict[str, CommandRange]:
    """Return the ranges of the channels that both parts command other than neutral, by role."""
    ranges = {}
    for role in ROLES:
        own, tested = (_extremes(part, role, getattr(neutral, role)) for part in (training, test))
        if np.isfinite(own).any() and np.isfinite(tested).any():
            ranges[role] = CommandRange(_range_of(own), _range_of(tested))
    return ranges


def beyond_range(readings: Readings, ranges: dict[str, CommandRange], neutral: Command) -> NDArray[np.bool_]:
    """Return which windows have a command outside the training range by more than 5 % of its width, (W,).

    Neutral counts as within: every map is known there.
    """
    beyond = np.zeros(len(readings), dtype=np.bool_)
    for role, of_channel in ranges.items():
        low, high = of_channel.training
        margin = _TOLERANCE * (high - low)
        smallest, largest = _extremes(readings, role, getattr(neutral, role)).T
        beyond |= (smallest < low - margin) | (largest > high + margin)
    return beyond


def _extremes(readings: Readings, role: str, neutral: float) -> Floats:
    """Return the smallest and the largest command but neutral during each window (W, 2); NaN without any."""
    out = np.full((len(readings), 2), np.nan)
    for k, (run, begins_s, t_s) in enumerate(zip(readings.runs, readings.begins_s, readings.t_s, strict=True)):
        during = (run.commands.t_s > begins_s) & (run.commands.t_s <= t_s[-1])
        values: Floats = getattr(run.commands, role)[during]
        values = np.append(values, held_command(run.commands, role, np.array([begins_s])))
        values = values[np.isfinite(values) & (values != neutral)]
        if len(values):
            out[k] = values.min(), values.max()
    return out


def _range_of(extremes: Floats) -> tuple[float, float]:
    return float(np.nanmin(extremes[:, 0])), float(np.nanmax(extremes[:, 1]))
