"""Discrepancy terms in free driving: causes outside the library, of a vehicle that shares no code with it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from free_drives import FREE_HEADER, RECORDED_FROM_S, circling, free_runs
from tiny_vehicle import HEADER, NEUTRAL_COMMAND, InMemory, Tiny, supply_v

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.discrepancy.command_history import command_history
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.terms import TERMS
from agvbench.types import Commands, Run, TimeSeries
from agvbench.vehicle.geometry import Geometry
from agvbench.workflows.diagnosis_files import term_in_words

NOT_FOR_WINDOWS = {
    "speed_by_run_time",
    "steering_at_start",
    "steering_by_turned_heading",
    "turn_while_coasting",
    "twist_at_start",
    "wave_by_distance",
}
COMPARING = "comparing terms for what no effect of the library describes"


def diagnosed(truth: Tiny, said: list[str] | None = None):
    runs = free_runs(truth, sessions=3, runs=2, by=circling)
    return diagnose(InMemory(runs, FREE_HEADER), on_progress=(said if said is not None else []).append)


@pytest.mark.parametrize(
    ("truth", "name", "covariate", "parameters"),
    [
        (
            Tiny(slow_patch=0.3),
            "speed_in_disc",
            "x_m",
            {"loss": (0.3, 0.01), "x_m": (0.6, 0.02), "y_m": (0.3, 0.02), "radius_m": (0.7, 0.02)},
        ),
        pytest.param(
            Tiny(pull_mps=0.02),
            "drift_to_point",
            "x_m",
            {"mps": (0.02, 0.002), "x_m": (0.3, 0.05), "y_m": (-0.2, 0.05)},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            Tiny(sag_per_rad=0.3),
            "speed_after_steering",
            "history",
            {"loss_per_rad": (0.3, 0.03), "time_constant_s": (0.6, 0.06)},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["slow patch", "pull to a point", "supply that sags"],
)
def test_a_cause_outside_the_library_is_described_and_not_named(truth, name, covariate, parameters):
    found = diagnosed(truth)
    assert found.verdict is Verdict.UNKNOWN
    assert f"it depends on {covariate}, and {name} describes it" in found.why
    term = found.provenance["empirical_term"]
    assert term["name"] == name
    for parameter, (value, tolerance) in parameters.items():
        assert term["parameters"][parameter] == pytest.approx(value, abs=tolerance)
    assert found.effects == ()
    assert found.next_experiment is None
    errors = found.held_out.errors["position_rms_mm"]
    assert errors["after"] < 0.25 * errors["before"]
    held_out = term["held_out_position_mm"]
    assert held_out["with"] < 0.25 * held_out["without"]
    shape, holds = term_in_words(found.to_json())
    assert shape.startswith(f"{name}: {next(iter(parameters))} = ")
    assert holds.startswith("It holds in the test windows: position error ")


def test_no_term_is_tried_within_repeatability():
    said: list[str] = []
    found = diagnosed(Tiny(), said)
    assert COMPARING not in said
    assert "empirical_term" not in found.provenance
    assert not list(term_in_words(found.to_json()))


def test_an_effect_of_the_library_leaves_nothing_to_a_term():
    said: list[str] = []
    found = diagnosed(Tiny(steering_lag_s=0.3), said)
    assert {effect.name for effect in found.effects} == {"steering_lag"}
    assert "empirical_term" not in found.provenance


@pytest.mark.parametrize("term", TERMS, ids=lambda term: term.name)
def test_windows_have_no_terms_of_a_beginning_or_an_end(term):
    is_of_campaign = term.covariates[0] == "campaign_time_h"
    assert term.for_windows is not (is_of_campaign or term.name in NOT_FOR_WINDOWS)


def with_supply(truth: Tiny, *, is_noise: bool = False) -> list[Run]:
    """Return free driving with the voltage of the supply logged, or another one that has nothing to do with it."""
    rng = np.random.default_rng(3)
    runs = free_runs(truth, sessions=3, runs=2)
    volts = [
        12.0 + 0.4 * rng.normal(size=len(run.frames)) if is_noise
        else supply_v(run.started_s + RECORDED_FROM_S + run.frames.t_s)
        for run in runs
    ]  # fmt: skip
    return [
        dataclasses.replace(run, logged={"supply_V": TimeSeries(run.frames.t_s, own)})
        for run, own in zip(runs, volts, strict=True)
    ]


@pytest.mark.parametrize(
    "truth",
    [
        Tiny(per_volt=0.15),
        # A lag of the drive mimics the slow change of the speed, and would leave nothing to the voltage.
        pytest.param(Tiny(per_volt=0.15, delay_s=0.1, steering_lag_s=0.1), marks=pytest.mark.slow),
    ],
    ids=["alone", "beside a delay and a lag"],
)
def test_a_supply_that_was_logged_explains_what_changes_within_a_recording(truth):
    found = diagnose(InMemory(with_supply(truth), FREE_HEADER))
    assert [d.covariate for d in found.depends_on] == ["supply_V"]
    assert "speed_lag" not in {effect.name for effect in found.effects}
    term = found.provenance["empirical_term"]
    assert term["name"] == "speed_by_logged_column"
    change = term["parameters"]["change"] / term["parameters"]["deviation"]
    assert change == pytest.approx(0.15, rel=0.1)
    assert term["held_out_position_mm"]["with"] < 0.4 * term["held_out_position_mm"]["without"]


@pytest.mark.parametrize(
    "truth",
    [Tiny(), pytest.param(Tiny(per_volt=0.15), marks=pytest.mark.slow)],
    ids=["nothing hidden", "another voltage matters"],
)
def test_a_supply_that_matters_nothing_describes_nothing(truth):
    found = diagnose(InMemory(with_supply(truth, is_noise=truth.per_volt > 0.0), FREE_HEADER))
    assert "empirical_term" not in found.provenance
    assert not found.depends_on or found.depends_on[0].covariate != "supply_V"


def test_a_term_that_does_not_hold_is_said_to_be_worse():
    term = {
        "name": "speed_in_disc",
        "parameters": {"loss": 0.3012, "radius_m": 1},
        "held_out_position_mm": {"with": 9, "without": 4},
    }
    assert list(term_in_words({"provenance": {"empirical_term": term}})) == [
        "speed_in_disc: loss = 0.301, radius_m = 1.",
        "It does not hold in the test windows: position error 9 mm with it, 4 mm without it (as fitted).",
    ]


def held_and_repeated(run: Run) -> tuple[Run, Run]:
    """Return a run whose commands are held for half a second, and the same with a row each tenth of a second."""
    commands = run.commands
    first = np.arange(len(commands.t_s)) // 5 * 5
    repeated = Commands(commands.t_s, *(values[first] for values in (commands.drive, commands.front, commands.rear)))
    return (
        dataclasses.replace(run, commands=repeated.without_repeats()),
        dataclasses.replace(run, commands=repeated),
    )


def test_the_command_history_of_windows_does_not_depend_on_rows_that_repeat_the_row_before():
    geometry = Geometry(HEADER.front_axle_m, HEADER.rear_axle_m)
    pairs = [held_and_repeated(run) for run in free_runs(Tiny(), sessions=2, runs=1, by=circling)]
    histories = []
    for runs in zip(*pairs, strict=True):
        readings = read_windows(runs, Horizon(2.0, 1.0), NEUTRAL_COMMAND)
        static = static_maps(readings, runs, geometry, NEUTRAL_COMMAND)
        batch = Batch(readings, static.predictor.maps, geometry)
        rates = residual_rates(readings, static.predictor.predict(static.parameters))
        histories.append(dataclasses.asdict(command_history(batch, static.parameters, rates)))
    held, repeated = histories
    for name, values in held.items():
        np.testing.assert_allclose(repeated[name], values, rtol=1e-9, atol=1e-12, err_msg=name)
