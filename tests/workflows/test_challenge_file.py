"""A challenge goes on where it was interrupted."""

from __future__ import annotations

import dataclasses
import json

import pytest

from agvbench.errors import FileError, FlagError
from agvbench.workflows.challenge import run_challenge
from agvbench.workflows.challenge_file import known_trials, write_trials
from agvbench.workflows.challenge_scores import Trial

LAG = Trial(
    "steering_lag", 3, "library", ("steering_lag",), ("steering_lag",), (), False, False,
    {"steering_lag": {"time_constant_s": 0.1}}, "NAMED", ("steering_lag",), (), ("x_m",),
    {"steering_lag": {"time_constant_s": (0.11, float("nan"))}}, {"before": 9.0, "after": 1.0, "floor": 1.0},
)  # fmt: skip


def same(a, b):
    return repr(dataclasses.asdict(a)) == repr(dataclasses.asdict(b))


def test_what_was_written_is_known_again(tmp_path):
    file = tmp_path / "deep" / "challenge.json"
    write_trials(file, 5, [LAG])
    found = known_trials(file, 5)
    assert list(found) == [("steering_lag", 3)]
    assert same(found["steering_lag", 3], LAG)
    assert not list(file.parent.glob("*.part"))


def test_trials_that_the_file_holds_are_not_held_again(tmp_path, capsys):
    file = tmp_path / "challenge.json"
    write_trials(file, 5, [LAG])
    before = file.read_bytes()
    scores = run_challenge(1, first_seed=3, specs=["steering_lag"], repeats=5, jobs=1, json_file=str(file), resume=True)
    assert scores.trials == 1
    assert file.read_bytes() == before
    assert "1 blind trials" in capsys.readouterr().out


@pytest.mark.parametrize("content", ["", "[]", '{"each": [{"spec": 1}], "repeats": 5}', '{"repeats": 5}'])
def test_another_file_is_told_in_one_line(tmp_path, content):
    file = tmp_path / "challenge.json"
    file.write_text(content)
    with pytest.raises(FileError, match="holds no challenge") as caught:
        known_trials(file, 5)
    assert "\n" not in str(caught.value)


def test_other_repeats_are_told(tmp_path):
    file = tmp_path / "challenge.json"
    write_trials(file, 5, [LAG])
    assert json.loads(file.read_text())["repeats"] == 5
    with pytest.raises(FileError, match="other repeats"):
        known_trials(file, 4)


def test_to_resume_without_a_file_is_told():
    with pytest.raises(FlagError, match="--resume"):
        run_challenge(1, first_seed=0, specs=[], repeats=5, jobs=1, json_file=None, resume=True)
