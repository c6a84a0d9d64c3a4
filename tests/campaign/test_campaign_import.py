from __future__ import annotations

import hashlib
import math
import resource
from pathlib import Path

import numpy as np
import pytest
from campaign_samples import MAPPING, recording, write_csv
from hypothesis import given
from hypothesis import strategies as st

from agvbench.campaign import Campaign, import_recordings
from agvbench.cli import main
from agvbench.errors import RecordingError
from agvbench.vehicle.quaternion import heading_of


def _imported(directory: Path, mapping: str = MAPPING, **recordings: dict[str, list[object]]) -> Campaign:
    (directory / "mapping.toml").write_text(mapping, encoding="utf-8")
    delimiter = ";" if 'delimiter = ";"' in mapping else ","
    files = [write_csv(directory / f"{name}.csv", table, delimiter=delimiter) for name, table in recordings.items()]
    return import_recordings(directory / "mapping.toml", files, directory / "c")


def test_units_axes_and_held_commands(tmp_path: Path) -> None:
    run = next(iter(_imported(tmp_path, r=recording())))
    t_s = np.arange(60) * 0.01
    np.testing.assert_allclose(run.frames.t_s, t_s)
    np.testing.assert_allclose(run.frames.x_m, 1.0)
    np.testing.assert_allclose(run.frames.y_m, 0.5 * t_s)
    np.testing.assert_allclose(run.frames.heading_rad, math.pi / 2)
    np.testing.assert_allclose(run.commands.t_s, [0.0, 0.3])
    np.testing.assert_array_equal(run.commands.drive, [1900.0, 1800.0])
    np.testing.assert_array_equal(run.commands.rear, 1500.0)
    assert (run.run_id, run.session, run.experiment, run.repeat) == ("r-001", "r", "free", 0)
    assert run.extra == {"source": "r.csv", "source_row": 1}
    assert not run.target.is_finite


@pytest.mark.parametrize(("every_ms", "is_standing"), [(20, False), (50, False), (500, True)])
def test_times_that_are_a_little_coarse_are_imported(tmp_path: Path, every_ms: int, is_standing: bool) -> None:
    table = recording(200)
    table["t"] = [every_ms * (t // every_ms) for t in table["t"]]
    if is_standing:  # a camera may repeat the pose of a vehicle at rest
        table["Z"] = [0.0] * 200
    run = next(iter(_imported(tmp_path, r=table)))
    assert len(run.frames) == 200


def test_rows_are_accounted_for_one_by_one(tmp_path: Path) -> None:
    table = recording(400)
    table["armed"] = [0] * 50 + [1] * 350
    table["X"][100] = ""  # not seen
    table["X"][120] = 9000.0  # jumped
    table["t"] = [t + (2000 if row >= 300 else 0) for row, t in enumerate(table["t"])]  # a gap of 2 s
    table["armed"][310:320] = [0] * 10  # leaves ten rows that are too short for a run
    gate = "[gate]\nmax_speed_m_per_s = 2.0\nmax_yaw_rate_rad_per_s = 5.0\n"
    campaign = _imported(tmp_path, MAPPING + gate, r=table)
    account = campaign.table("import").iloc[0]
    expected = {"rows": 400, "not_driven": 60, "not_seen": 1, "jumped": 1, "too_short": 10, "used": 328, "runs": 2}
    assert account[list(expected)].to_dict() == expected
    assert account["sha256"] == hashlib.sha256((tmp_path / "r.csv").read_bytes()).hexdigest()
    assert [len(run.frames) for run in campaign] == [250, 80]
    assert sum(int(run.frames.tracked.sum()) for run in campaign) == 328
    first = campaign.run("r-001")
    assert first.extra["source_row"] == 51
    assert first.frames.t_s[~first.frames.tracked].tolist() == [0.5, 0.7]


@pytest.mark.parametrize(("longest_s", "count"), [(10.0, 1), (0.59, 1), (0.5, 2), (0.2, 3)])
def test_long_pieces_are_divided_evenly(tmp_path: Path, longest_s: float, count: int) -> None:
    runs = list(_imported(tmp_path, MAPPING + f"longest_s = {longest_s}\n", r=recording()))
    durations = [run.frames.t_s[-1] for run in runs]
    assert len(runs) == count
    assert max(durations) <= longest_s + 1e-9
    assert max(durations) - min(durations) < 0.02
    assert sum(len(run.frames) for run in runs) == 60
    assert all(run.commands.t_s[0] == 0.0 for run in runs)


def test_a_column_may_say_where_a_run_ends(tmp_path: Path) -> None:
    table = recording() | {"trial": [1] * 25 + [2] * 35}
    runs = list(_imported(tmp_path, MAPPING.replace("[columns]", '[columns]\ncut = "trial"'), r=table))
    assert [len(run.frames) for run in runs] == [25, 35]


def test_sessions_names_and_rules(tmp_path: Path) -> None:
    rules = """
[[files]]
match = "sweep_*"
experiment = "steering_front"
session = "morning"
[[files]]
match = "*"
condition = "calibrated"
"""
    campaign = _imported(tmp_path, MAPPING + rules, sweep_1=recording(), sweep_2=recording(), drive=recording())
    runs = campaign.runs
    assert runs["run_id"].tolist() == ["sweep_1-001", "sweep_2-001", "drive-001"]
    assert runs["session"].tolist() == ["morning", "morning", "drive"]
    assert runs["experiment"].tolist() == ["steering_front", "steering_front", "free"]
    assert runs["condition"].tolist() == ["", "", "calibrated"]
    np.testing.assert_allclose(runs["started_s"], [0.0, 0.59, 1.18])  # clocks that start anew are put end to end


def test_iso_times_and_sessions_by_day(tmp_path: Path) -> None:
    mapping = MAPPING.replace('unit = "ms"', 'unit = "iso8601", clock = "absolute"') + 'session = "day"\n'
    monday, tuesday = recording(), recording()
    monday["t"] = [f"2024-09-16T07:00:00.{10 * row:03d}Z" for row in range(60)]
    tuesday["t"] = [f"2024-09-17 07:00:00.{10 * row:03d}" for row in range(60)]
    campaign = _imported(tmp_path, mapping, tuesday=tuesday, monday=monday)
    assert campaign.runs["session"].tolist() == ["2024-09-16", "2024-09-17"]
    assert campaign.runs["started_s"].tolist() == [0.0, 86400.0]
    np.testing.assert_allclose(campaign.run("monday-001").frames.t_s, np.arange(60) * 0.01, atol=1e-6)


def test_another_csv_dialect(tmp_path: Path) -> None:
    table = recording()
    table["X"] = ["1000,5"] * 60
    mapping = MAPPING + '\n[csv]\ndelimiter = ";"\ndecimal = ","\n'
    run = next(iter(_imported(tmp_path, mapping, r=table)))
    np.testing.assert_allclose(run.frames.x_m, 1.0005)


def test_an_empty_command_cell_repeats_the_one_before(tmp_path: Path) -> None:
    table = recording() | {"throttle": ["", "", 1900, *[""] * 27, 1700, *[""] * 29]}
    campaign = _imported(tmp_path, r=table)
    commands = campaign.run("r-001").commands
    np.testing.assert_array_equal(commands.drive, [1900.0, 1700.0])
    np.testing.assert_allclose(commands.t_s, [0.0, 0.28])
    assert campaign.table("import")["not_driven"].tolist() == [2]  # no command was known yet


def test_what_else_was_logged_is_kept_with_the_poses_and_held(tmp_path: Path) -> None:
    table = recording()
    table["mV"] = ["", 12000, "", 11800] + [""] * 56
    mapping = MAPPING + '[logged]\nbattery_V = { column = "mV", scale = 0.001 }\n'
    _imported(tmp_path, mapping, r=table)
    run = next(iter(Campaign.open(tmp_path / "c")))
    assert set(run.logged) == {"battery_V"}
    np.testing.assert_array_equal(run.logged["battery_V"].t_s, run.frames.t_s)
    np.testing.assert_allclose(run.logged["battery_V"].value, [np.nan, 12.0, 12.0] + [11.8] * 57)


def test_flags_may_be_words_and_mark_lost_frames(tmp_path: Path) -> None:
    table = recording() | {"armed": ["Auto"] * 60, "seen": ["True"] * 10 + ["False"] * 10 + ["True"] * 40}
    mapping = MAPPING.replace("equals = 1", 'equals = "auto"')
    mapping = mapping.replace("[columns]", '[columns]\ntracked = { column = "seen", equals = true }')
    run = _imported(tmp_path, mapping, r=table).run("r-001")
    assert run.frames.tracked.tolist() == [True] * 10 + [False] * 10 + [True] * 40


def test_the_same_recordings_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        _imported(tmp_path / name, r=recording())
    for file in (tmp_path / "one").rglob("*.parquet"):
        if file.is_file():
            assert file.read_bytes() == (tmp_path / "two" / file.relative_to(tmp_path / "one")).read_bytes()


@given(yaw=st.floats(-3.1, 3.1), tilt=st.floats(-1.0, 1.0), length=st.floats(0.1, 3.0))
def test_heading_of_a_tilted_body_with_z_up(yaw: float, tilt: float, length: float) -> None:
    # Turning about the floor's normal after pitching about the body's own y leaves the heading at the turn.
    turn = np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])
    pitch = np.array([0.0, math.sin(tilt / 2), 0.0, math.cos(tilt / 2)])
    product = _multiply(turn, pitch) * length
    assert heading_of(product[None], "x", "x", "y")[0] == pytest.approx(yaw, abs=1e-9)


def test_heading_has_no_value_at_the_poles_and_for_no_rotation() -> None:
    up = np.array([0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)])
    values = heading_of(np.array([up, np.zeros(4), np.full(4, np.nan), [0.0, 0.0, 0.0, 1.0]]), "x", "x", "y")
    assert np.isnan(values).tolist() == [True, True, True, False]


def _multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])


def test_the_command_tells_what_became_of_the_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mapping.toml").write_text(MAPPING)
    files = [str(write_csv(tmp_path / f"{name}.csv", recording())) for name in ("one", "two")]
    assert main(["import", "--mapping", str(tmp_path / "mapping.toml"), *files, "--out", str(tmp_path / "c")]) == 0
    out = capsys.readouterr().out
    assert "one.csv" in out
    assert "120" in out
    assert "runs: 2, sessions: 2" in out


@pytest.mark.parametrize("is_new", [True, False])
def test_an_import_that_cannot_be_written_to_its_end_leaves_no_campaign(is_new: bool, tmp_path: Path) -> None:
    """A campaign with some of its runs would pass for a whole one."""
    (tmp_path / "mapping.toml").write_text(MAPPING)
    long = recording(6000) | {"Z": [-5.0 * row + row * 7919 % 1009 / 1009 for row in range(6000)]}
    files = [write_csv(tmp_path / "a.csv", recording()), write_csv(tmp_path / "b.csv", long)]
    out = tmp_path / "c"
    if not is_new:
        out.mkdir()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(RecordingError, match=r"c: cannot be written .*; free some space, or choose another"):
            import_recordings(tmp_path / "mapping.toml", files, out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not out.exists() if is_new else not list(out.iterdir())
    campaign = import_recordings(tmp_path / "mapping.toml", files, out)
    assert campaign.run_ids == ["a-001", "b-001"]
    assert not list(out.glob(".tmp*"))
