"""Settings of a session: checked, kept, and not to be contradicted on resume."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import pytest

from agvbench.errors import AgvbenchError, FileError, FlagError
from agvbench.model import thesis_vehicle
from agvbench.planning.trajectories.segments import Steering
from agvbench.running.configuration.session_options import OPTIONS
from agvbench.running.configuration.settings import SETTINGS_FILE, STEERINGS, BenchSettings, settings_for_resume
from agvbench.running.session.opening import open_session
from agvbench.vehicle.geometry import Geometry


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("repeats", -1, "--repeats"),
        ("attempts", 0, "--attempts"),
        ("seed", -3, "--seed"),
        ("seed", 2**64, "--seed"),
        ("order", "random", "interleaved, blocked, shuffled"),
        ("maps", "spline", "default, thesis"),
        ("steering", "sideways", "abeam, front, rear"),
        ("exchange", 0.05, "--exchange"),
        ("exchange", float("nan"), "--exchange"),
    ],
)
def test_values_that_cannot_be_used_name_flag_value_and_limit(option, value, words):
    with pytest.raises(FlagError) as caught:
        BenchSettings(**{option: value})
    line = str(caught.value)
    assert words in line
    assert str(value) in line
    assert "\n" not in line


def test_settings_survive_the_file(tmp_path):
    settings = BenchSettings(seed=7, repeats=3, plant="a b.py:make", order="shuffled", full=True)
    settings.save(tmp_path)
    assert BenchSettings.load(tmp_path) == settings


@pytest.mark.parametrize("text", ["seed = ", "colour = 'red'", "seed = -1", "\xff\xfe"])
def test_damaged_settings_are_told_in_one_line(tmp_path, text):
    (tmp_path / SETTINGS_FILE).write_text(text, encoding="latin-1")
    with pytest.raises(AgvbenchError) as caught:
        BenchSettings.load(tmp_path)
    assert "\n" not in str(caught.value)


def test_nothing_to_resume_says_so(tmp_path):
    with pytest.raises(FileError, match="no bench session to resume"):
        BenchSettings.load(tmp_path)


def test_resume_keeps_what_was_begun_and_refuses_contradictions():
    saved = BenchSettings(seed=7, repeats=3)
    assert settings_for_resume(saved, {"seed": 7, "connect": "tcp/127.0.0.1:1"}).connect == "tcp/127.0.0.1:1"
    with pytest.raises(FlagError, match=r"--seed: .*: 8 \(limit: 7\)"):
        settings_for_resume(saved, {"seed": 8})


def test_options_of_the_plant_are_kept_and_not_to_be_contradicted(tmp_path):
    BenchSettings(plant_option="backlash_m=0.01").save(tmp_path)
    saved = BenchSettings.load(tmp_path)
    assert settings_for_resume(saved, {}).plant_option == "backlash_m=0.01"
    with pytest.raises(FlagError, match=r"--plant-option: .*: backlash_m=0.02 \(limit: backlash_m=0.01\)"):
        settings_for_resume(saved, {"plant_option": "backlash_m=0.02"})
    wrong = {"plant_option": "backlsh_m=0.01"}
    for dry_run in (True, False):
        with (
            pytest.raises(
                FlagError, match=r"--plant-option: not an option of agvbench\.simulator:make_plant: 'backlsh_m'"
            ),
            open_session(wrong, out=str(tmp_path / "c"), resume=False, dry_run=dry_run),
        ):
            pass


def test_cameras_are_told_what_is_wanted_of_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {"camera": "rate_hz=60,lost=0"}
    with open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        assert session._bench.link.identity().mocap_rate_hz == 60.0
    given = {"camera": "lost"}
    with (
        pytest.raises(FlagError, match="--camera: not a parameter and its value: 'lost'; write NAME=VALUE"),
        open_session(given, out=str(tmp_path / "d"), resume=False, dry_run=False),
    ):
        pass


def test_a_camera_that_cannot_tell_a_vehicle_at_rest_is_refused(tmp_path):
    with (
        pytest.raises(FlagError, match=r"--mocap: camera frame rate too low .*: 15 Hz \(limit: at least 25 Hz\)"),
        open_session({"camera": "rate_hz=15"}, out=str(tmp_path / "c"), resume=False, dry_run=False),
    ):
        pass


def test_the_rig_knows_the_vehicle_s_name_and_what_calibration_is_believed(tmp_path):
    file = tmp_path / "vehicle.toml"
    thesis_vehicle().save(file)
    given = {"vehicle_name": "blue", "calibration": str(file)}
    with open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        identity = session._bench.link.identity()
    assert (identity.vehicle, identity.calibration_hash) == ("blue", thesis_vehicle().calibration_hash)


def test_a_dry_run_plans_for_the_vehicle_that_is_believed(tmp_path):
    file = tmp_path / "vehicle.toml"
    small = replace(thesis_vehicle(), geometry=Geometry(0.05, 0.06))
    small.save(file)
    with open_session({"vehicle": str(file)}, out=str(tmp_path / "c"), resume=False, dry_run=True) as session:
        assert session.model("calibrated").geometry == small.geometry


def test_a_campaign_may_be_renamed_between_sessions_and_lie_where_one_stands(tmp_path, monkeypatch):
    (tmp_path / "tonight").mkdir()
    monkeypatch.chdir(tmp_path / "tonight")
    with open_session({}, out=".", resume=False, dry_run=False) as session:
        assert session._bench.writer.header.name == "tonight"
    (tmp_path / "tonight").rename(tmp_path / "monday")
    with open_session({}, out=str(tmp_path / "monday"), resume=True, dry_run=False) as session:
        assert session._bench.writer.header.name == "tonight"


def test_the_modes_of_steering_are_those_of_trajectories():
    assert get_args(Steering) == STEERINGS


def test_every_option_is_a_field_with_help():
    flags = [flag for flag, _, _ in OPTIONS]
    assert flags == [
        f"--{f.name.replace('_', '-')}" for f in fields(BenchSettings) if f.name not in {"benchmarks", "only"}
    ]
    assert all(text for _, _, text in OPTIONS)


@pytest.mark.parametrize("file", sorted((Path(__file__).parents[2] / "benchmarks").glob("bench_*.py")), ids=str)
def test_the_help_of_repeats_names_the_benchmarks_that_declare_their_own(file):
    (option,) = (option for option in fields(BenchSettings) if option.name == "repeats")
    declares = "@pytest.mark.repeats(" in file.read_text(encoding="utf-8")
    exceptions = option.metadata["help"].partition(";")[2]
    assert (file.stem.removeprefix("bench_") in exceptions) is declares
