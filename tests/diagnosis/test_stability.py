"""Change during a campaign: found in repeats, told apart by its shape, and no reason to refuse."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from histories import history_of
from tiny_vehicle import FRONT_M, HEADER, REAR_M, InMemory, Tiny, campaign_runs

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.checks.consistency import require_consistent_repeats
from agvbench.diagnosis.data.readings import Readings, read_runs
from agvbench.diagnosis.discrepancy.campaign_time import columns_by_campaign_time, complement, is_constant
from agvbench.diagnosis.discrepancy.command_history import CommandHistory
from agvbench.diagnosis.discrepancy.screening import screen
from agvbench.diagnosis.discrepancy.stability import stability_test
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.residuals.covariate_test import Dependence
from agvbench.errors import CampaignError
from agvbench.types import Run
from agvbench.vehicle.geometry import Geometry

GEOMETRY = Geometry(FRONT_M, REAR_M)
COMMANDS, REPEATS, STEPS, STEP_M, SPEED_MPS = 30, 4, 12, 0.1, 0.3
RUNS = COMMANDS * REPEATS
GROUP = np.tile(np.arange(COMMANDS), REPEATS)
"""Each command once, then each once again: repeats are spread over the campaign."""
STARTED_H = np.linspace(0.0, 1.2, RUNS)


def readings(sessions: list[str | None] | None = None) -> Readings:
    """Return runs of which only groups, times and sessions matter."""
    run: Run = campaign_runs(Tiny())[0]
    runs = tuple(dataclasses.replace(run, session=name) for name in sessions or [None] * RUNS)
    nothing = np.zeros((RUNS, 3))
    return Readings(runs, np.zeros((RUNS, 1)), np.zeros((RUNS, 1, 3)), nothing, nothing, STARTED_H, GROUP, {})


def drives(seed: int) -> tuple[Rates, CommandHistory]:
    """Return residual rates of runs that begin to turn, with errors of runs and of steps, and what steered."""
    rng = np.random.default_rng(seed)
    by_command = rng.uniform(-0.4, 0.4, (COMMANDS, 2))
    run = np.repeat(np.arange(RUNS), STEPS)
    tangent = np.tan(by_command[GROUP])[run]
    curvature = (tangent[:, 0] - tangent[:, 1]) / (FRONT_M + REAR_M)
    heading = (
        rng.uniform(-3.0, 3.0, RUNS)[:, None] + curvature.reshape(RUNS, STEPS) * STEP_M * np.arange(STEPS)
    ).ravel()
    begin = np.column_stack([rng.uniform(-1.0, 1.0, (RUNS * STEPS, 2)), heading])
    end = begin + np.column_stack([STEP_M * np.cos(heading), STEP_M * np.sin(heading), curvature * STEP_M])
    one = np.ones(RUNS * STEPS)
    covariates = {
        "x_m": begin[:, 0],
        "y_m": begin[:, 1],
        "heading_rad": np.mod(heading, 2.0 * np.pi),
        "course_rad": np.mod(heading, 2.0 * np.pi),
        "time_in_run_s": np.tile(STEP_M / SPEED_MPS * np.arange(STEPS), RUNS),
        "distance_m": np.tile(STEP_M * (np.arange(STEPS) + 0.5), RUNS),
        "sideslip": 0.0 * one,
        "campaign_time_h": STARTED_H[run],
        "speed_mps": SPEED_MPS * one,
        "direction": one,
        "curvature_per_m": curvature,
    }
    value = rng.normal(0.0, 0.01, (RUNS, 3))[run] + rng.normal(0.0, 0.01, (RUNS * STEPS, 3))
    levels = np.column_stack([np.zeros(len(run)), GROUP[run], GROUP[run]]).astype(np.int64)
    rates = Rates(run, value, STEP_M * one, covariates, begin, end, np.tile(np.arange(STEPS), RUNS))
    # The axles were at neutral before.
    return rates, history_of(tangent, np.zeros_like(tangent), levels)


def change_of(rates: Rates, history: CommandHistory, of: Readings | None = None) -> Dependence | None:
    found = stability_test(rates, columns_by_campaign_time(rates, history, GEOMETRY), of or readings(), 0)
    return found[0] if found else None


def changed(rates: Rates, history: CommandHistory, through: str, share: np.ndarray, size: float = 0.02) -> Rates:
    """Return the rates with a change of the quantity that is called `through`."""
    value = rates.value.copy()
    for term, columns in columns_by_campaign_time(rates, history, GEOMETRY):
        if term.name == through:
            for feature, column in columns.items():
                value[:, feature] += size * share[rates.run] * column[:, 0]
    return dataclasses.replace(rates, value=value)


def test_random_errors_are_rarely_a_change():
    assert [found for seed in range(40) if (found := change_of(*drives(seed))) is not None] == []


TERMS = [term for term, _ in columns_by_campaign_time(*drives(0), GEOMETRY)]


@pytest.mark.parametrize("name", [term.name for term in TERMS])
def test_a_change_of_any_quantity_in_a_part_of_the_campaign_is_found(name):
    rates, history = drives(1)
    inside = ((STARTED_H > 0.5) & (STARTED_H < 0.9)).astype(np.float64)
    found = change_of(changed(rates, history, name, inside), history)
    assert found is not None
    assert found.covariate == "campaign_time_h"
    assert found.p_value == pytest.approx(1.0 / 5000.0)


def test_a_gain_that_fades_is_found_though_left_and_right_cancel():
    rates, history = drives(2)
    fade = -np.expm1(-STARTED_H / 0.5)
    found = change_of(changed(rates, history, "steering_by_campaign_time", fade, 0.08), history)
    assert found is not None
    assert found.feature == "steering"


def test_what_depends_on_the_command_only_is_no_change():
    rates, history = drives(3)
    by_command = np.random.default_rng(0).normal(0.0, 0.2, COMMANDS)[GROUP]
    moved = dataclasses.replace(rates, value=rates.value + by_command[rates.run, None])
    assert change_of(moved, history) is None


def test_a_change_between_sessions_is_said_to_depend_on_the_session():
    rates, history = drives(4)
    sessions = ["monday" if GROUP[k] % 2 == k // COMMANDS % 2 else "tuesday" for k in range(RUNS)]
    tuesday = np.array([name == "tuesday" for name in sessions], dtype=np.float64)
    found = change_of(changed(rates, history, "speed_by_campaign_time", tuesday), history, readings(sessions))
    assert found is not None
    assert found.covariate == "session"


@pytest.mark.parametrize("name", [term.name for term in TERMS])
def test_a_part_of_the_campaign_is_found_between_the_right_runs(name):
    rates, history = drives(5)
    inside = ((STARTED_H > 0.5) & (STARTED_H < 0.9)).astype(np.float64)
    (best, *_) = screen(changed(rates, history, name, inside, 0.05), history, GEOMETRY, GROUP, 0)
    assert best.term.name == name
    begins_h, ends_h, time_constant_h = best.values[0][-3:]
    assert begins_h == pytest.approx(0.5, abs=0.02)
    assert ends_h == pytest.approx(0.9, abs=0.02)
    assert time_constant_h == 0.0


def test_a_step_has_an_opposite_step_in_the_rest_of_the_campaign():
    late = np.array([0.01, -0.02, 0.5, 1e3, 0.0])
    early = complement(late, STARTED_H)
    assert early.tolist() == [-0.01, 0.02, 0.0, 0.5, 0.0]
    assert complement(early, STARTED_H).tolist() == late.tolist()


@pytest.mark.parametrize("values", [(0.01, 0.3, 0.8, 0.0), (0.01, 0.0, 1e3, 0.4)])
def test_a_part_in_the_middle_and_a_slow_change_have_no_opposite(values):
    assert complement(np.array(values), STARTED_H) is None


def _turned(runs: list[Run], angles_rad: Sequence[float]) -> list[Run]:
    """Return the runs with their paths turned by an angle each about their start, as of another vehicle or floor."""

    def turned(run: Run, angle_rad: float) -> Run:
        c, s, f = np.cos(angle_rad), np.sin(angle_rad), run.frames
        x, y = f.x_m - f.x_m[0], f.y_m - f.y_m[0]
        frames = dataclasses.replace(f, x_m=f.x_m[0] + c * x - s * y, y_m=f.y_m[0] + s * x + c * y)
        return dataclasses.replace(run, frames=frames)

    return [turned(run, angle) for run, angle in zip(runs, angles_rad, strict=True)]


def _spread_over_an_evening() -> list[Run]:
    """Return the runs of a campaign in which every command is driven early and late."""
    runs, seen, out = campaign_runs(Tiny()), {}, []
    for number, run in enumerate(runs):
        key = run.commands.drive.tobytes() + run.commands.front.tobytes() + run.commands.rear.tobytes()
        seen[key] = seen.get(key, -1) + 1
        out.append(dataclasses.replace(run, started_s=20.0 * (number + len(runs) * seen[key])))
    return sorted(out, key=lambda run: run.started_s)


def test_repeats_of_two_kinds_are_refused_unless_time_divides_them():
    runs = _spread_over_an_evening()
    late = np.array([0.5 * (run.started_s > 20.0 * len(runs)) for run in runs])
    assert 0.2 < np.mean(late > 0.0) < 0.8
    require_consistent_repeats(read_runs(_turned(runs, late)), where="campaign tiny")
    at_random = np.random.default_rng(1).permutation(late)
    with pytest.raises(CampaignError, match="two kinds"):
        require_consistent_repeats(read_runs(_turned(runs, at_random)), where="campaign tiny")


def test_repeats_that_each_differ_by_another_amount_are_evidence_and_no_second_vehicle():
    runs = _spread_over_an_evening()
    random = np.random.default_rng(1)
    disturbed = np.where(random.random(len(runs)) < 0.5, random.uniform(0.1, 0.6, len(runs)), 0.0)
    assert require_consistent_repeats(read_runs(_turned(runs, disturbed)), where="campaign tiny") is None


@pytest.mark.slow
def test_a_campaign_whose_steering_gain_fades_is_not_adequate():
    found = diagnose(InMemory(campaign_runs(Tiny(warm_gain=-0.06)), HEADER))
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects == ()
    assert found.depends_on[0].covariate == "campaign_time_h"


@pytest.mark.parametrize(
    ("course", "constant"),
    [((0.004, 1e3, 0.0), True), ((0.0, 1e3, 1e-6), True), ((0.5, 1e3, 0.0), False), ((0.0, 1e3, 2.0), False)],
)
def test_a_change_that_holds_in_nearly_all_runs_is_none(course, constant):
    hours = np.linspace(0.0, 1.0, 150)
    assert is_constant(np.array([0.06, *course]), hours) is constant
