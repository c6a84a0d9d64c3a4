"""Test windows with commands that no training window has: the model extrapolates there, and the answer says so."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from free_drives import FREE_HEADER, free_runs, joystick
from rich.console import Console
from tiny_vehicle import NEUTRAL_COMMAND, Tiny

from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.diagnosis.data.readings import Readings, read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.free_driving.command_range import beyond_range, command_ranges
from agvbench.reporting.console.diagnosis import print_diagnosis
from agvbench.types import Commands, Run
from agvbench.workflows.diagnosis_files import extrapolation_in_words

LAGGING = Tiny(steering_lag_s=0.25)


def windows(runs: list[Run]) -> Readings:
    """Return the windows of runs."""
    return read_windows(runs, Horizon(2.0, 1.0), NEUTRAL_COMMAND)


@pytest.fixture(scope="module")
def driven() -> list[Run]:
    """Return two runs of free driving."""
    return free_runs(Tiny(), sessions=1, runs=2, seconds=12.0)


def with_steering(runs: list[Run], front: float) -> list[Run]:
    """Return runs as if the front axle had one command throughout."""

    def steered(commands: Commands) -> Commands:
        return Commands(commands.t_s, commands.drive, np.full_like(commands.front, front), commands.rear)

    return [replace(run, commands=steered(run.commands)) for run in runs]


def test_windows_are_not_beyond_their_own_range(driven):
    own = windows(driven)
    ranges = command_ranges(own, own, NEUTRAL_COMMAND)
    assert set(ranges) == {"front", "rear", "drive"}
    assert all(of_channel.training == of_channel.test for of_channel in ranges.values())
    assert not beyond_range(own, ranges, NEUTRAL_COMMAND).any()


@pytest.mark.parametrize(
    ("front", "is_beyond"), [(1391.0, False), (1389.0, True), (1609.0, False), (1611.0, True), (1500.0, False)]
)
def test_a_command_outside_by_more_than_a_twentieth_of_the_range_is_beyond(driven, front, is_beyond):
    one, other = with_steering(driven, 1400.0), with_steering(driven, 1600.0)
    training, test = windows([one[0], other[1]]), windows(with_steering(driven, front))
    ranges = command_ranges(training, test, NEUTRAL_COMMAND)
    assert (beyond_range(test, ranges, NEUTRAL_COMMAND) == is_beyond).all()


def test_neutral_is_within_where_every_other_command_was_on_one_side(driven):
    training = windows(with_steering(driven, 1400.0))
    ranges = {"front": replace(command_ranges(training, training, NEUTRAL_COMMAND)["front"], training=(1380.0, 1400.0))}
    assert not beyond_range(windows(with_steering(driven, 1500.0)), ranges, NEUTRAL_COMMAND).any()
    assert beyond_range(windows(with_steering(driven, 1402.0)), ranges, NEUTRAL_COMMAND).all()


class Recorded:
    """Three sessions with little steering for training, and one with much for the test."""

    header = FREE_HEADER

    def __init__(self, reach: float) -> None:
        fitted = free_runs(LAGGING, sessions=3, runs=2, seconds=24.0, by=partial(joystick, reach=0.5))
        tested = free_runs(LAGGING, sessions=1, runs=2, seconds=24.0, by=partial(joystick, reach=reach), seed=1)
        self.runs = [replace(run, split="fit") for run in fitted]
        self.runs += [
            replace(run, split="held_out", session="last", run_id=f"last-{k}") for k, run in enumerate(tested)
        ]

    def __iter__(self):
        return iter(self.runs)


@pytest.fixture(scope="module")
def beyond() -> Diagnosis:
    """Return the diagnosis of recordings whose test session steers twice as far."""
    return diagnose(Recorded(reach=1.0))


def test_errors_within_and_beyond_add_up_to_those_of_the_recording(beyond):
    rows = [row for row in beyond.provenance["windows"]["recordings"] if row["held_out"]]
    assert rows
    for row in rows:
        parts = [row[key] for key in ("within", "beyond") if key in row]
        assert "beyond" in row
        assert sum(part["windows"] for part in parts) == row["windows"]
        for name in ("static_mm", "after_mm"):
            squares = [part["windows"] * part["ahead_2_s"][name]["rms"] ** 2 for part in parts]
            assert sum(squares) == pytest.approx(row["windows"] * row["ahead_2_s"][name]["rms"] ** 2)


def test_the_answer_says_which_commands_are_missing_in_the_training_windows(beyond):
    content = json.loads(beyond.to_text())
    (words,) = extrapolation_in_words(content)
    front = content["provenance"]["windows"]["commands"]["front"]
    # The training sessions steer at most 175 µs to either side, the test session up to 350 µs.
    assert 1325.0 <= front["training"][0] < front["training"][1] <= 1675.0
    assert front["test"][0] < 1300.0
    assert front["test"][1] > 1700.0
    assert f"front {front['test'][0]:.4g} to {front['test'][1]:.4g}" in words
    assert "drive" not in words.partition(":")[2].partition("(")[0]
    console = Console(width=200, record=True)
    print_diagnosis(beyond, console)
    said = console.export_text()
    assert words in " ".join(said.split())
    assert f"beyond ({content['provenance']['windows']['recordings'][-1]['beyond']['windows']})" in said


def test_nothing_is_said_where_the_training_windows_have_every_command():
    found = diagnose(Recorded(reach=0.4))
    assert not list(extrapolation_in_words(found.to_json()))
    assert not any("beyond" in row for row in found.provenance["windows"]["recordings"])


def test_an_edited_file_does_not_stop_the_words():
    for windows_of_file in (
        {"recordings": [{"held_out": True, "beyond": {"windows": 2}}], "commands": {"front": 3}},
        7,
    ):
        assert all(extrapolation_in_words({"provenance": {"windows": windows_of_file}}))
