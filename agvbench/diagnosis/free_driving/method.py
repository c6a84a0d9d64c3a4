"""The diagnosis of free driving: windows in place of runs from rest."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.checks.sufficiency import NEVER_DRIVEN
from agvbench.diagnosis.context import require_runs
from agvbench.diagnosis.criteria import DATA, SESSION_CLOCK
from agvbench.diagnosis.data.initial_pose import is_driven
from agvbench.diagnosis.data.readings import Readings, read_windows
from agvbench.diagnosis.data.session_clocks import aligned, clock_offsets
from agvbench.diagnosis.data.splits import Split
from agvbench.diagnosis.data.window_splits import fitted_windows, held_out_windows, test_sessions, thinned
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.design.propose import with_next_experiment
from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.free_driving.conclusion import WindowConclusion
from agvbench.diagnosis.free_driving.describing_term import SelectionWithTerm, with_describing_term
from agvbench.diagnosis.free_driving.drive_level import DriveLevel, drive_levels, nodal_deviation
from agvbench.diagnosis.free_driving.lag_or_variation import without_mimicking_lags
from agvbench.diagnosis.free_driving.maps import NODES, smooth_maps, start_values_of_windows
from agvbench.diagnosis.free_driving.predictors import autocorrelation_time
from agvbench.diagnosis.free_driving.selection import WindowSelector, select_drive
from agvbench.diagnosis.method import Method
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.selection.actuators import ACTUATORS, separate_channels
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.diagnosis.selection.initial_steering import choose_initial_steering, select_with_initial_steering
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import candidates_for
from agvbench.errors import CampaignError
from agvbench.types import Command, Run
from agvbench.vehicle.geometry import Geometry

ABSORBED_IN_WINDOWS = frozenset({"mocap_scale"})
"""Effects that the maps absorb where no distance is known but by the camera."""


@dataclass(frozen=True)
class SelectedFromWindows:
    """Static maps without effects, the selector, its selection, and the level of the drive of each session.

    ``with_term`` is the selection with a discrepancy term, if one describes what the effects leave.
    """

    static: Fit
    selector: WindowSelector
    selection: Selection
    levels: Mapping[str, DriveLevel]
    with_term: SelectionWithTerm | None


@dataclass
class FreeDriving(Method[SelectedFromWindows]):
    """Diagnoses free driving by windows, each predicted from its measured initial state over the `horizon`.

    Errors are those at the horizon. Differences of the drive level between sessions are estimated from the initial
    speed of each window, if there are several sessions.
    """

    no_test: ClassVar[str] = "no stretch of driving can be spared for the test: drive for longer"
    horizon: Horizon

    def read(self, runs: Sequence[Run]) -> Readings:
        """Return the poses of the windows on one clock, and the priors of the vehicle file."""
        found = self._windows(runs)
        if not len(found):
            return found
        tested = test_sessions(found, held_out_windows(found, self.context.seed))
        offsets = clock_offsets(runs, is_differential=self.context.geometry.is_differential, partial=tested)
        moved = {name for name, offset in offsets.items() if offset.significant}
        if moved:
            found = self._windows(aligned(runs, offsets))
            found = found.select(~_adapting(found, moved & tested))
        return replace(found, clock_offsets=offsets)

    def _windows(self, runs: Sequence[Run]) -> Readings:
        is_differential = self.context.geometry.is_differential
        read = read_windows(runs, self.horizon, self.context.header.neutral, turns_on_the_spot=is_differential)
        return replace(read, priors=self.context.priors)

    def insufficient_data(self, readings: Readings) -> str:
        """Return why the campaign cannot be diagnosed, or an empty string."""
        require_runs(readings, self.context.header)
        if len(readings) < DATA.min_windows:
            raise CampaignError(
                "too little free driving to diagnose",
                where=f"campaign {self.context.header.name}",
                value=f"{len(readings)} windows of {self.horizon.horizon_s:g} s",
                limit=f"at least {DATA.min_windows}",
                remedy="drive for longer, or predict less far ahead (campaign.toml, [prediction] horizon_s)",
            )
        if (stretches := len(np.unique(readings.group))) < DATA.min_blocks:
            return f"{stretches} stretches of {self.horizon.block_s:g} s are too few for a test: drive for longer"
        is_differential, neutral = self.context.geometry.is_differential, self.context.header.neutral
        if not any(is_driven(run.commands, neutral, turns_on_the_spot=is_differential).any() for run in readings.runs):
            return NEVER_DRIVEN
        turned = np.nanmax(np.abs(readings.poses[..., 2] - readings.start[:, None, 2]), axis=1)
        if np.count_nonzero(turned > DATA.min_turn_rad) < DATA.min_blocks:
            return "steering was never excited: hardly a window turns"
        return ""

    def split(self, readings: Readings) -> Split:
        """Return the training and test windows; no window is for validation."""
        test = held_out_windows(readings, self.context.seed)
        return Split(~test, np.zeros_like(test), test)

    def select(self, readings: Readings, split: Split) -> SelectedFromWindows:
        """Select effects in evenly spaced training windows."""
        fitted = fitted_windows(readings.select(split.training))
        self.on_progress(f"{len(fitted)} training windows, {np.count_nonzero(split.test)} test windows")
        static = static_maps(fitted, readings.runs, self.context.geometry, self.context.header.neutral)
        levels = self._drive_levels(readings, split, static)
        selector = self._selector(readings, split, static, levels)
        selection, selector = self._selected_effects(selector)
        return SelectedFromWindows(static, selector, selection, levels, with_describing_term(selection, selector))

    @staticmethod
    def _selected_effects(selector: WindowSelector) -> tuple[Selection, WindowSelector]:
        """Return the effects, by channel and with variants where these predict better, and their selector."""
        selection, selector = select_with_initial_steering(choose_initial_steering(selector))
        separate, selector = separate_channels(selection, selector)
        if separate is not selection:
            selection = selector.select(separate.chosen, ACTUATORS)
        selection, selector = select_drive(selection, selector)
        selection = without_mimicking_lags(selection, selector)
        return selector.with_alternatives(selection), selector

    def conclude(self, readings: Readings, split: Split, selected: SelectedFromWindows) -> Diagnosis:
        """Open the test windows, and return the diagnosis."""
        self.on_progress("computing the errors of the test windows")
        readings = replace(readings, preset=selected.selector.batch.readings.preset)
        trained = thinned(np.flatnonzero(split.training), DATA.max_assessed_windows)
        assessed = np.sort(np.r_[np.flatnonzero(split.test), trained])
        found = WindowConclusion(
            self.context,
            readings,
            split,
            assessed,
            selected.static,
            selected.selector,
            selected.selection,
            selected.levels,
            selected.with_term,
        ).diagnosis(self.horizon)
        if selected.with_term:
            return found
        self.on_progress("choosing the run to drive next")
        return with_next_experiment(found, selected.selection, readings, self.context.header, self.context.seed)

    def _selector(
        self, readings: Readings, split: Split, static: Fit, levels: Mapping[str, DriveLevel]
    ) -> WindowSelector:
        """Return the selector for the training windows of `static`, with the level of the drive if sessions differ."""
        differ = any(level.significant for level in levels.values())
        deviation = nodal_deviation(static.predictor, static.parameters) if differ else np.inf
        test = thinned(np.flatnonzero(split.test), DATA.max_fitted_windows)
        return self._selector_with(deviation, readings.select(test), static)

    @staticmethod
    def _drive_levels(readings: Readings, split: Split, static: Fit) -> dict[str, DriveLevel]:
        """Return the level of the drive of each session, if there are several, from evenly spaced windows."""
        chosen = [thinned(np.flatnonzero(part), DATA.max_fitted_windows) for part in (split.training, split.test)]
        every = readings.select(np.sort(np.concatenate(chosen)))
        return drive_levels(every, static.predictor, static.parameters) if _has_sessions(every) else {}

    def _selector_with(self, deviation: float, test: Readings, static: Fit) -> WindowSelector:
        """Return the selector for a given deviation of the level; see `Simulation.predict`."""
        context, fitted, maps = self.context, static.predictor.readings, static.predictor.maps
        tried, kinds = candidates_for(context.vehicle, context.geometry)
        tried = {name: one for name, one in tried.items() if name not in ABSORBED_IN_WINDOWS}
        given = given_effects(context.vehicle, tried)
        fitted_maps = fit(
            Predictor(Batch(fitted, maps, context.geometry, deviation)), static.parameters, np.empty((0, 2))
        )
        redundancy = autocorrelation_time(fitted_maps)
        return WindowSelector(
            Batch(fitted, maps, context.geometry, deviation, redundancy, kinds),
            tried,
            fitted_maps.parameters,
            context.seed,
            self.on_progress,
            *given,
            test_batch=Batch(test, maps, context.geometry, deviation, kinds=kinds),
        )


def _adapting(readings: Readings, sessions: Collection[str]) -> NDArray[np.bool_]:
    """Return which windows begin in the part of these sessions from which their clock offset was estimated, (W,)."""
    names = np.array([run.session or "" for run in readings.runs])
    elapsed_s = 3600.0 * readings.started_h + readings.begins_s
    return np.isin(names, list(sessions)) & (elapsed_s < SESSION_CLOCK.adapted_s)


def _has_sessions(readings: Readings) -> bool:
    return readings.initial_states is not None and len(np.unique(readings.initial_states.session)) > 1


def static_maps(fitted: Readings, runs: Sequence[Run], geometry: Geometry, neutral: Command) -> Fit:
    """Return the static maps fitted to the windows, with the number of nodes by Schwarz's criterion.

    Their nodes span the commands of all `runs`, too: beyond those of the fitted windows, the prior of smoothness
    continues a map with its slope.
    """
    best: tuple[float, Fit] | None = None
    for steering, drive in NODES:
        maps = smooth_maps(fitted.runs, neutral, steering, drive, runs, is_differential=geometry.is_differential)
        start = start_values_of_windows(maps, fitted, geometry)
        found = fit(Predictor(Batch(fitted, maps, geometry)), start, np.empty((0, 2)))
        total = float(found.loss.sum()) + maps.size * float(np.log(len(fitted)))
        if best is not None and total > best[0]:
            break
        best = total, found
    assert best is not None, "there is a first choice of nodes"  # noqa: S101
    return best[1]
