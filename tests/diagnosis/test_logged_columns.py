"""Columns that a lab logs: what is a covariate, what is left out and why, and that they are named where they matter."""

from __future__ import annotations

import dataclasses
import datetime
import decimal
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from free_drives import FREE_HEADER, free_runs
from logged_drives import by_battery, by_chance, by_operator, by_temperature, by_time, logged_runs
from tiny_vehicle import InMemory, Tiny, campaign_runs

from agvbench.campaign import Campaign
from agvbench.diagnosis import Verdict, diagnose, terms
from agvbench.diagnosis.checks.consistency import require_consistent_repeats
from agvbench.diagnosis.criteria import LOGGED
from agvbench.diagnosis.data.logged import LoggedColumns, logged_columns
from agvbench.diagnosis.data.readings import Readings, read_runs, read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.discrepancy.stability import stability_test
from agvbench.diagnosis.residuals.body_rates import LoggedSteps, Rates, residual_rates
from agvbench.diagnosis.residuals.covariate_test import Dependence, dependences
from agvbench.errors import CampaignError
from agvbench.types import Run, TimeSeries

RUNS, TIMES_S = 40, np.linspace(0.0, 2.0, 5)
RNG = np.random.default_rng(3)
NUMBERS = RNG.normal(12.0, 0.3, RUNS).tolist()
HOURS = np.linspace(0.0, 1.0, RUNS)


def read(cells: dict[str, list[object]], **of_run: list[object]) -> LoggedColumns:
    """Return what is read of runs with these cells of the runs table."""
    runs = [
        SimpleNamespace(
            extra={name: values[i] for name, values in cells.items() if values[i] is not None},
            logged=of_run["logged"][i] if "logged" in of_run else {},
            firmware=of_run["firmware"][i] if "firmware" in of_run else "1",
            started_s=3600.0 * HOURS[i],
        )
        for i in range(RUNS)
    ]
    return logged_columns(runs, np.tile(TIMES_S, (RUNS, 1)), HOURS)  # type: ignore[arg-type]


def names(found: LoggedColumns) -> list[str]:
    return [column.name for column in found.columns]


@pytest.mark.parametrize(
    ("cells", "missing"),
    [
        (NUMBERS, 0),
        ([f" {v:.3f} " for v in NUMBERS], 0),
        ([decimal.Decimal(f"{v:.3f}") for v in NUMBERS], 0),
        ([v if k % 4 else math.nan for k, v in enumerate(NUMBERS)], 10),
        ([v if k % 4 else None for k, v in enumerate(NUMBERS)], 10),
        ([f"{v:.3f}" if k % 4 else "" for k, v in enumerate(NUMBERS)], 10),
        ([f"{v:.3f}" if k % 4 else "nan" for k, v in enumerate(NUMBERS)], 10),
        ([v if k % 4 else math.inf for k, v in enumerate(NUMBERS)], 10),
        ([v if k % 4 else 10**400 for k, v in enumerate(NUMBERS)], None),
        ([v if k % 4 else -1e300 for k, v in enumerate(NUMBERS)], 10),
    ],
)
def test_numbers_are_a_covariate_whatever_their_type_and_gaps(cells, missing):
    found = read({"battery_V": cells})
    if missing is None:
        assert found.left_out == {"battery_V": "neither numbers nor texts"}
        return
    assert names(found) == ["battery_V"]
    per_run = found.columns[0].per_run
    assert np.count_nonzero(np.isnan(per_run)) == missing
    z = found.standardised(RUNS)[:, 0]
    assert np.isfinite(z).all()
    assert np.all(z[np.isnan(per_run)] == 0.0)
    assert np.std(z[np.isfinite(per_run)]) == pytest.approx(1.0, abs=0.05)


def test_a_typing_error_does_not_decide_the_size_of_a_term():
    found = read({"battery_V": [*NUMBERS[:-1], 119.0]})
    assert np.abs(found.standardised(RUNS)).max() == LOGGED.max_standardised


OPERATORS = [("anna", "bo", "cy")[k % 3] for k in RNG.permutation(RUNS)]


def test_a_text_has_one_regressor_per_level_and_one_for_two_levels():
    found = read({"operator": OPERATORS, "tyres": [f" {'hard' if k % 5 else 'soft'}" for k in range(RUNS)]})
    assert names(found) == ["operator", "tyres"]
    assert [r.level for r in found.regressors] == ["anna", "bo", "cy", "soft"]


def test_a_level_of_few_runs_counts_as_missing_and_a_truth_value_is_a_text():
    found = read({"operator": ["dora", *OPERATORS[1:]], "charged": [k % 3 == 0 for k in range(RUNS)]})
    assert [column.levels for column in found.columns] == [("anna", "bo", "cy"), ("False", "True")]
    assert math.isnan(found.columns[0].per_run[0])


@pytest.mark.parametrize(
    ("name", "cells", "reason"),
    [
        ("floor", ["lab"] * RUNS, "constant"),
        ("mass_kg", [1.25] * RUNS, "constant"),
        ("note", [f"run {k}" for k in range(RUNS)], "an identifier or a remark: most texts differ"),
        ("note", ["x" * 1_000_000 + str(k) for k in range(RUNS)], "an identifier or a remark: most texts differ"),
        ("place", [f"tile {k % 10}" for k in range(RUNS)], "10 different texts, more than 8"),
        ("battery_id", NUMBERS, "an identifier, by its name"),
        ("number", list(range(100, 100 + RUNS)), "counts the runs: campaign_time_h and run_order are covariates"),
        ("clock_s", (1.7e9 + 3600.0 * HOURS).tolist(), "counts the runs: campaign_time_h and run_order are covariates"),
        ("battery_V", [v if k < 12 else None for k, v in enumerate(NUMBERS)], "a value in 12 runs, fewer than 20"),
        ("battery_V", [math.nan] * RUNS, "a value in 0 runs, fewer than 20"),
        ("speed_mps", NUMBERS, "the diagnosis has a covariate of this name: rename it"),
        ("day", [datetime.date(2026, 11, 1 + k % 20) for k in range(RUNS)], "neither numbers nor texts"),
        ("list", [[1.0, k] for k in range(RUNS)], "neither numbers nor texts"),
        ("mixed", [v if k % 2 else "low" for k, v in enumerate(NUMBERS)], "neither numbers nor texts"),
    ],
)
def test_what_is_no_covariate_is_left_out_with_the_reason(name, cells, reason):
    found = read({name: cells})
    assert found.left_out == {name: reason}
    assert found.stated() == {"covariates": [], "left_out": {name: reason}}
    assert found.standardised(RUNS).shape == (RUNS, 0)


@pytest.mark.parametrize("name", ["", " ", "a\nb", "\x1b[31mred", "x" * 5000])
def test_a_name_that_cannot_be_printed_is_left_out(name):
    (reason,) = read({name: NUMBERS}).left_out.values()
    assert reason == "its name is empty, longer than 60 characters or not printable"
    assert all(label.isprintable() and len(label) < 70 for label in read({name: NUMBERS}).left_out)


def test_columns_that_agvbench_writes_are_no_covariates():
    cells = dict.fromkeys(("duration_s", "events", "placing_position_error_m", "source_row"), NUMBERS)
    assert read(cells).stated() == {}


def test_the_number_of_columns_is_bounded():
    found = read({f"c{k}": RNG.normal(size=RUNS).tolist() for k in range(200)})
    assert len(found.columns) == len(found.regressors) == LOGGED.max_regressors
    left_out = found.stated()["left_out"]
    assert len(left_out) == 51
    assert "more than 16 regressors" in left_out["c16"]
    assert left_out["…"] == "134 further columns"


def test_a_column_of_the_poses_is_averaged_over_its_samples():
    t_s = np.linspace(-0.5, 3.0, 50)
    ramps = [{"motor_C": TimeSeries(t_s, v + 0.5 * t_s)} for v in NUMBERS]
    ramps[0] = {"motor_C": TimeSeries(t_s, np.full(50, np.nan))}
    found = read({}, logged=ramps)
    (column,) = found.columns
    assert column.values[1:] == pytest.approx(np.array(NUMBERS)[1:, None] + 0.5 * TIMES_S)
    assert column.per_run[1:] == pytest.approx(np.array(NUMBERS)[1:] + 0.5)
    assert np.isnan(column.values[0]).all()


def test_firmware_is_a_covariate_where_there_are_two():
    assert names(read({}, firmware=["1" if k % 2 else "2" for k in range(RUNS)])) == ["firmware"]
    assert read({}, firmware=["1"] * RUNS).stated() == {}


def test_run_order_is_a_covariate_unless_it_is_the_time():
    assert names(read({"battery_V": NUMBERS})) == ["battery_V"]
    runs = [
        SimpleNamespace(extra={"battery_V": v}, logged={}, firmware="", started_s=1e5 * (k // 10) + 60.0 * (k % 10))
        for k, v in enumerate(NUMBERS)
    ]
    found = logged_columns(runs, np.tile(TIMES_S, (RUNS, 1)), np.arange(RUNS) % 10 / 60.0)  # type: ignore[arg-type]
    assert names(found) == ["battery_V", "run_order"]


def test_columns_of_both_tables_are_read_from_files(tmp_path: Path, write_campaign: Callable[[Path, list[Run]], Path]):
    runs = [
        dataclasses.replace(
            run,
            extra={"battery_V": 7.0 + 0.01 * (k * 37 % 50), "operator": ("anna", "bo")[k % 2]},
            logged={"motor_C": TimeSeries(run.frames.t_s, 30.0 + np.sin(k + run.frames.t_s))},
        )
        for k, run in enumerate(campaign_runs(Tiny()))
    ]
    path = write_campaign(tmp_path / "logged", runs)
    found = read_runs(list(Campaign.open(path))).logged
    assert names(found) == ["battery_V", "operator", "motor_C"]
    in_memory = read_runs(runs).logged
    for one, other in zip(found.columns, in_memory.columns, strict=True):
        np.testing.assert_allclose(one.values, other.values)
    # As a lab would add them: to a single table of each kind, with numbers as text.
    table = Campaign.open(path).poses.drop(columns="motor_C")
    table["supply_V"] = [f"{v:.2f}" if v > 7.5 else "" for v in np.random.default_rng(0).uniform(7.4, 8.4, len(table))]
    poses = tmp_path / "logged" / "poses.parquet"
    for part in poses.iterdir():
        part.unlink()
    poses.rmdir()
    (tmp_path / "logged" / "SHA256SUMS").unlink()
    table.to_csv(tmp_path / "logged" / "poses.csv", index=False)
    assert pd.read_csv(tmp_path / "logged" / "poses.csv")["supply_V"].isna().any()
    assert names(read_runs(list(Campaign.open(path))).logged) == ["battery_V", "operator", "supply_V"]


def test_two_kinds_of_repeats_are_evidence_where_a_logged_text_divides_them():
    runs = campaign_runs(Tiny())
    second = np.random.default_rng(1).permutation(len(runs)) % 2

    def turned(run: Run, angle_rad: float) -> Run:
        c, s, f = math.cos(angle_rad), math.sin(angle_rad), run.frames
        x, y = f.x_m - f.x_m[0], f.y_m - f.y_m[0]
        return dataclasses.replace(
            run, frames=dataclasses.replace(f, x_m=f.x_m[0] + c * x - s * y, y_m=f.y_m[0] + s * x + c * y)
        )

    of_two = [turned(run, 0.5 * k) for run, k in zip(runs, second, strict=True)]
    with pytest.raises(CampaignError, match="two kinds"):
        require_consistent_repeats(read_runs(of_two), where="campaign tiny")
    logged = [
        dataclasses.replace(run, extra={"wheel_set": "AB"[k]}) for run, k in zip(of_two, second.tolist(), strict=True)
    ]
    require_consistent_repeats(read_runs(logged), where="campaign tiny")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("conditions", "covariate", "term"),
    [
        (by_battery, "battery_V", "speed_by_logged_column"),
        (by_temperature, "temperature_C", "steering_by_logged_column"),
        (by_operator, "operator", "trim_by_logged_column"),
    ],
)
@pytest.mark.slow
def test_a_logged_column_that_matters_is_named_first_and_reduces_the_error(conditions, covariate, term):
    found = diagnose(InMemory(logged_runs(conditions)))
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects == ()
    assert found.depends_on[0].covariate == covariate
    assert found.provenance["empirical_term"]["name"] == term
    assert found.provenance["empirical_term"]["covariate"] == covariate
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] < 0.5 * position["before"]
    assert found.to_json()["provenance"]["logged_columns"] == {"covariates": [covariate], "left_out": {}}


@pytest.mark.slow
def test_columns_that_do_not_matter_change_no_verdict():
    found = diagnose(InMemory(logged_runs(by_chance)))
    assert found.verdict is Verdict.ADEQUATE
    assert found.depends_on == ()
    assert len(found.to_json()["provenance"]["logged_columns"]["covariates"]) == 5


@pytest.mark.slow
def test_where_only_time_matters_it_is_named_though_a_column_was_logged():
    found = diagnose(InMemory(logged_runs(by_time)))
    assert found.verdict is Verdict.UNKNOWN
    assert [d.covariate for d in found.depends_on] == ["campaign_time_h"]


def test_windows_of_free_driving_have_the_columns_of_their_run():
    runs = [
        dataclasses.replace(
            run,
            extra={"battery_V": 7.0 + 0.1 * (5 * k % 12)},
            logged={"motor_C": TimeSeries(run.frames.t_s, 30.0 + run.frames.t_s)},
        )
        for k, run in enumerate(free_runs(Tiny()))
    ]
    readings = read_windows(runs, Horizon(), FREE_HEADER.neutral)
    assert names(readings.logged) == ["battery_V", "motor_C", "run_order"]
    rates = residual_rates(readings, readings.poses + 0.001)
    steps = rates.logged["motor_C"].value - 30.0
    np.testing.assert_allclose(steps, rates.covariates["time_in_run_s"], atol=1e-6)
    few = readings.select(np.arange(0, len(readings), 7))
    np.testing.assert_array_equal(few.logged.columns[0].per_run, readings.logged.columns[0].per_run[::7])


def test_a_window_knows_of_a_column_what_was_logged_before_it_begins():
    runs = [
        dataclasses.replace(run, logged={"motor_C": TimeSeries(run.frames.t_s, np.floor(run.frames.t_s / 7.0))})
        for run in free_runs(Tiny(), sessions=2, runs=1)
    ]
    readings = read_windows(runs, Horizon(2.0, 1.0), FREE_HEADER.neutral)
    before = readings.logged.columns[0].per_run
    from_there = np.floor((readings.begins_s - 2.0).clip(0.0) / 7.0)
    assert np.all((from_there <= before) & (before <= np.floor(readings.begins_s / 7.0)))
    assert len(np.unique(before)) > 4
    matrix = readings.logged.matrix
    assert matrix is not None
    np.testing.assert_allclose(matrix[:, 0], (before - before.mean()) / before.std(), atol=1e-12)


def test_a_column_that_says_nothing_before_windows_is_no_regressor():
    """It is constant but for the last second, or begins late, or is a clock."""
    runs = [
        dataclasses.replace(
            run,
            logged={
                "switched_off": TimeSeries(run.frames.t_s, 8.4 + 0.1 * (run.frames.t_s > run.frames.t_s[-1] - 1.0)),
                "late": TimeSeries(run.frames.t_s[-60:], 12.0 + run.frames.t_s[-60:]),
                "clock": TimeSeries(run.frames.t_s, run.started_s + run.frames.t_s),
            },
        )
        for run in free_runs(Tiny(), sessions=2, runs=1)
    ]
    logged = read_windows(runs, Horizon(2.0, 1.0), FREE_HEADER.neutral).logged
    assert names(logged) == ["switched_off"]
    assert logged.regressors == ()
    assert logged.matrix is None
    assert logged.left_out["late"].startswith("a value in ")
    assert logged.left_out["clock"].startswith("counts the runs")


COMMANDS, REPEATS, STEPS = 30, 4, 12
GROUP = np.tile(np.arange(COMMANDS), REPEATS)
STARTED_H = np.linspace(0.0, 1.2, COMMANDS * REPEATS)


def chance(seed: int, logged: dict[str, list[object]], change: np.ndarray | float = 0.0) -> tuple[Rates, Readings]:
    """Return residual rates with errors of runs and of steps and a change of speed by run, and their runs."""
    rng, count = np.random.default_rng(seed), len(GROUP)
    runs = tuple(
        SimpleNamespace(
            extra={name: values[i] for name, values in logged.items()},
            logged={},
            firmware="",
            session=None,
            started_s=3600.0 * STARTED_H[i],
        )
        for i in range(count)
    )
    t_s = np.tile(np.linspace(0.0, 4.0, STEPS + 1), (count, 1))
    found = logged_columns(runs, t_s, STARTED_H)  # type: ignore[arg-type]
    nothing = np.zeros((count, 3))
    poses = np.zeros((count, STEPS, 3))
    readings = Readings(runs, t_s[:, 1:], poses, nothing, nothing, STARTED_H, GROUP, {}, logged=found)  # type: ignore[arg-type]
    run = np.repeat(np.arange(count), STEPS)
    value = rng.normal(0.0, 0.01, (count, 3))[run] + rng.normal(0.0, 0.01, (count * STEPS, 3))
    value[:, 0] += (np.zeros(count) + change)[run]
    covariates = {"campaign_time_h": STARTED_H[run], "curvature_per_m": rng.uniform(-2.0, 2.0, COMMANDS)[GROUP][run]}
    columns = {column.name: LoggedSteps(column.per_run[run], bool(column.levels)) for column in found.columns}
    still, step = np.zeros((len(run), 3)), np.tile(np.arange(STEPS), count)
    length = np.full(len(run), 0.1)
    return Rates(run, value, length, covariates, still, still, step, columns, found.matrix[run]), readings  # type: ignore[index]


def changes_of(rates: Rates, readings: Readings) -> list[Dependence]:
    every = np.ones((len(rates.run), 1))
    quantities = [(terms.SpeedByCampaignTime, {0: every}), (terms.ClockByCampaignTime, {1: every})]
    return stability_test(rates, quantities, readings, 0)


def five_columns(seed: int) -> dict[str, list[object]]:
    rng, count = np.random.default_rng([seed, 5]), len(GROUP)
    return {
        "battery_V": (8.4 - STARTED_H + rng.normal(0.0, 0.05, count)).tolist(),
        "temperature_C": rng.normal(20.0, 1.0, count).tolist(),
        "humidity": np.where(rng.random(count) < 0.8, rng.uniform(size=count), np.nan).tolist(),
        "operator": rng.choice(["anna", "bo", "cy"], count).tolist(),
        "wheel_set": rng.choice(["A", "B"], count).tolist(),
    }


def test_columns_that_do_not_matter_are_rarely_called_a_dependence():
    found = []
    for seed in range(20):
        rates, readings = chance(seed, five_columns(seed))
        assert len(readings.logged.columns) == 5
        found += dependences(rates, GROUP, seed) + changes_of(rates, readings)
    assert len(found) <= 1  # at a level of one in a thousand, twice per campaign


def test_what_explains_the_change_of_repeats_best_is_named_first():
    logged = five_columns(0)
    volt, hours = np.array(logged["battery_V"], dtype=float), STARTED_H
    swapped = np.where(hours > 0.6, volt + 0.6, volt)  # a fresh pack half way
    logged["battery_V"] = swapped.tolist()
    by_battery_ = changes_of(*chance(0, logged, 0.05 * (swapped - swapped.mean())))
    assert [d.covariate for d in by_battery_] == ["battery_V", "campaign_time_h"]  # a drift that starts over
    by_time_ = changes_of(*chance(0, logged, 0.05 * (hours > 0.3)))
    assert by_time_[0].covariate == "campaign_time_h"
    assert by_time_[0].p_value < 0.001


def test_what_cannot_be_told_apart_is_listed_with_the_larger_share_first():
    logged = five_columns(1)
    volt = 8.4 - STARTED_H + np.random.default_rng(0).normal(0.0, 0.01, len(GROUP))
    logged["battery_V"] = volt.tolist()
    found = changes_of(*chance(1, logged, -0.05 * STARTED_H))
    assert {d.covariate for d in found} == {"battery_V", "campaign_time_h"}
    assert found[0].share >= found[1].share


def test_values_that_are_missing_do_not_hide_a_dependence():
    logged = five_columns(2)
    humidity = np.array(logged["humidity"], dtype=float)
    rates, _ = chance(2, logged, 0.1 * np.nan_to_num(humidity - np.nanmean(humidity)))
    (first, *_) = dependences(rates, GROUP, 0)
    assert (first.covariate, first.feature) == ("humidity", "speed")
