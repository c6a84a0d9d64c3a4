"""Trajectories from TOML, and back."""

import json
import tomllib

import pytest
import tomli_w

from agvbench.errors import FileError
from agvbench.planning import list_trajectories, load_trajectory, trajectory_from_table
from agvbench.planning.trajectories.loading import trajectory_files
from agvbench.planning.trajectories.trajectory import SHAPES
from agvbench.types import NO_TARGET

STRAIGHT = 'schema = 1\nname = "{name}"\n[[segments]]\nkind = "straight"\nlength_m = {length}\n'


def test_a_name_a_file_name_and_a_path_find_the_same(tmp_path):
    shipped = next(file for file in trajectory_files() if file.stem == "5_forward_left")
    assert load_trajectory("5") == load_trajectory("5_forward_left") == load_trajectory(str(shipped))
    assert load_trajectory(shipped) == load_trajectory("5")


def test_a_lab_s_own_trajectory_goes_before_the_shipped_one(tmp_path, monkeypatch):
    (tmp_path / "trajectories").mkdir()
    (tmp_path / "trajectories" / "mine.toml").write_text(STRAIGHT.format(name="1", length=1.0))
    monkeypatch.chdir(tmp_path)
    assert load_trajectory("1").segments[0].length_m == 2.0
    (tmp_path / "trajectories" / "mine.toml").rename(tmp_path / "trajectories" / "1_mine.toml")
    assert load_trajectory("1").segments[0].length_m == 1.0
    assert load_trajectory("5").name == "5"
    assert [t.name for t in list_trajectories()] == ["1"]


def test_one_name_for_two_trajectories_is_refused(tmp_path):
    for file in ("a.toml", "b.toml"):
        (tmp_path / file).write_text(STRAIGHT.format(name="same", length=1.0))
    with pytest.raises(FileError, match=r"b\.toml: trajectory name 'same' is taken; see a\.toml"):
        list_trajectories(tmp_path)


def test_the_shipped_ones_show_every_shape_and_the_eight_come_first():
    found = list_trajectories()
    assert [t.name for t in found[:8]] == list("12345678")
    assert {t.shape for t in found} == set(SHAPES)


@pytest.mark.parametrize("trajectory", list_trajectories(), ids=lambda t: t.name)
def test_a_trajectory_survives_toml_and_json(trajectory):
    table = trajectory.to_table()
    assert trajectory_from_table(tomllib.loads(tomli_w.dumps(table))) == trajectory
    assert trajectory_from_table(json.loads(json.dumps(table))) == trajectory


def test_kinds_of_experiment_follow_from_the_shape():
    kinds = {t.name: t.experiment for t in list_trajectories()}
    assert {name: kinds[name] for name in ("5", "step_steer", "speed_steps", "endurance", "pulses")} == {
        "5": "trajectory",
        "step_steer": "step",
        "speed_steps": "step",
        "endurance": "endurance",
        "pulses": "free",
    }


def test_circles_for_hours_aim_at_nothing():
    assert load_trajectory("endurance").stated_target is NO_TARGET


@pytest.mark.parametrize("content", [b"\xff\xfe", b"schema = 1\nname = \x80"])
def test_a_file_that_is_no_text_is_refused(tmp_path, content):
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(FileError, match="is not UTF-8 text"):
        load_trajectory(tmp_path / "x.toml")


def test_a_directory_is_no_trajectory(tmp_path):
    (tmp_path / "x.toml").mkdir()
    with pytest.raises(FileError, match="cannot be read"):
        load_trajectory(tmp_path / "x.toml")


def test_a_file_that_begins_with_the_name_of_another_trajectory_is_not_taken_for_it(tmp_path, monkeypatch):
    own = tmp_path / "trajectories"
    own.mkdir()
    for name in ("slalom_fast", "5_laps"):
        (own / f"{name}.toml").write_text(STRAIGHT.format(name=name, length=1.0))
    monkeypatch.chdir(tmp_path)
    assert load_trajectory("slalom").shape == "slalom"
    assert load_trajectory("5").target.y_m != 0.0
    with pytest.raises(FileError, match="there is no trajectory 'figure'; did you mean"):
        load_trajectory("figure")
