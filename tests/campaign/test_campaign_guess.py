"""Guessed mappings: a recording written in any of many ways is imported as it was driven."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from campaign_samples import write_csv
from hypothesis import given
from hypothesis import strategies as st

from agvbench.campaign import Campaign, import_recordings
from agvbench.campaign.recordings.guess import guess_mapping
from agvbench.campaign.recordings.mapping import load_mapping
from agvbench.cli import main
from agvbench.errors import AgvbenchError, FileError
from agvbench.vehicle.channels import Channels

ROWS, RATE_HZ = 1000, 50.0


def drive() -> dict[str, np.ndarray]:
    """Return times, poses and commands of a figure eight, in SI units and −1…1."""
    t = np.arange(ROWS) / RATE_HZ
    steer = np.sin(0.6 * t)
    heading = np.cumsum(0.8 * steer) / RATE_HZ
    x, y = np.cumsum(0.5 * np.cos(heading)) / RATE_HZ, np.cumsum(0.5 * np.sin(heading)) / RATE_HZ
    return {"t": t, "x": x, "y": y, "heading": heading, "throttle": 0.4 + 0.1 * np.sin(t), "steer": steer}


def wrapped(angle: np.ndarray) -> np.ndarray:
    return np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi


def written(style: str) -> tuple[dict[str, list[float]], str]:
    """Return the columns of a recording in one of several styles, and the delimiter."""
    d = drive()
    if style == "plain":
        table, delimiter = {"t_s": d["t"], "x_m": d["x"], "y_m": d["y"], "heading_rad": d["heading"]}, ","
        table |= {"throttle": d["throttle"], "steering": d["steer"]}
    elif style == "milliseconds, millimetres and degrees":
        table, delimiter = {"Timestamp (ms)": 1e3 * d["t"], "Position X": 1e3 * d["x"], "Position Y": 1e3 * d["y"]}, ";"
        table |= {"Yaw": np.degrees(wrapped(d["heading"])), "cmd_drive": d["throttle"], "cmd_steer": d["steer"]}
    elif style == "clockwise":
        table, delimiter = {"time": d["t"], "pos_x": d["x"], "pos_y": d["y"], "yaw": -np.degrees(d["heading"])}, "\t"
        table |= {"throttle": d["throttle"], "steering": d["steer"]}
    elif style == "pulses since 1970":
        table, delimiter = {"epoch_ns": np.round(1e9 * (1.7e9 + d["t"])), "x": d["x"], "y": d["y"]}, ","
        table |= {"theta": d["heading"], "pwm_drive": 1500.0 + 400.0 * d["throttle"]}
        table |= {"pwm_front": 1500.0 + 300.0 * d["steer"], "pwm_rear": 1500.0 - 300.0 * d["steer"]}
    else:
        table, delimiter = {"t": d["t"], "x": d["x"], "y": d["y"], "yaw": d["heading"], "cmd_v": d["throttle"]}, ","
        table |= {"cmd_w": 0.8 * d["steer"], "enabled": (d["t"] > 1.0).astype(float)}
    return {name: [float(v) for v in values] for name, values in table.items()}, delimiter


STYLES = ("plain", "milliseconds, millimetres and degrees", "clockwise", "pulses since 1970", "differential")


def imported(directory: Path, style: str) -> tuple[Campaign, list[str]]:
    columns, delimiter = written(style)
    recording = write_csv(directory / "monday.csv", columns, delimiter=delimiter)
    text, questions = guess_mapping(recording)
    (directory / "mapping.toml").write_text(text, encoding="utf-8")
    return import_recordings(directory / "mapping.toml", [recording], directory / "c"), questions


@pytest.mark.parametrize("style", STYLES)
def test_a_recording_is_imported_as_it_was_driven(style, tmp_path):
    campaign, _ = imported(tmp_path, style)
    (run,) = list(campaign)
    truth = drive()
    first = ROWS - len(run.frames)
    assert first == (51 if style == "differential" else 0)
    np.testing.assert_allclose(run.frames.x_m, truth["x"][first:], atol=1e-6)
    np.testing.assert_allclose(run.frames.y_m, truth["y"][first:], atol=1e-6)
    np.testing.assert_allclose(wrapped(run.frames.heading_rad - truth["heading"][first:]), 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(run.frames.t_s), 1.0 / RATE_HZ, atol=1e-4)
    unit = {"pulses since 1970": "us", "differential": "si"}.get(style, "normalised")
    assert campaign.header.channels == Channels.alike(unit)
    assert campaign.header.geometry.is_differential is (style == "differential")
    assert campaign.header.mocap_rate_hz == pytest.approx(RATE_HZ, rel=0.01)


def test_a_decimal_comma_is_guessed(tmp_path):
    recording = write_csv(tmp_path / "r.csv", written("plain")[0], delimiter=";")
    recording.write_text(recording.read_text(encoding="utf-8").replace(".", ","), encoding="utf-8")
    text, _ = guess_mapping(recording)
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    (run,) = import_recordings(tmp_path / "mapping.toml", [recording], tmp_path / "c")
    np.testing.assert_allclose(run.frames.x_m, drive()["x"], atol=1e-6)


def test_what_no_column_tells_is_asked(tmp_path):
    _, questions = imported(tmp_path, "clockwise")
    assert any(question.startswith("yaw: counts clockwise") for question in questions)
    assert any("how far is the tracked point from both axles?" in question for question in questions)
    assert any(question.startswith("pos_x, pos_y: in m?") for question in questions)


def test_a_measured_speed_is_no_command(tmp_path):
    columns, _ = written("plain")
    columns = {"speed_odo_drive": columns["throttle"][::-1]} | columns
    text, _ = guess_mapping(write_csv(tmp_path / "r.csv", columns))
    assert 'drive = { column = "throttle" }' in text


def test_commands_that_are_never_negative_are_asked_about(tmp_path):
    columns, _ = written("plain")
    columns["steering"] = [0.5 + 0.5 * v for v in columns["steering"]]
    _, questions = guess_mapping(write_csv(tmp_path / "r.csv", columns))
    assert any("never negative" in question for question in questions)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("t_s"), "no column looks like a time that rises"),
        (lambda c: c["t_s"].reverse(), "no column looks like a time that rises"),
        (lambda c: c.pop("heading_rad"), "no column looks like heading .one of: t_s, x_m"),
        (lambda c: c.pop("steering"), "no column looks like front"),
        (lambda c: c.update({name: ["a"] * ROWS for name in c}), "has no rows of numbers"),
    ],
)
def test_a_recording_that_cannot_be_guessed_is_refused(change, message, tmp_path):
    columns, _ = written("plain")
    change(columns)
    with pytest.raises(FileError, match=message):
        guess_mapping(write_csv(tmp_path / "r.csv", columns))


def test_the_command_writes_the_mapping_and_says_what_to_answer(tmp_path, capsys):
    recording = write_csv(tmp_path / "r.csv", written("plain")[0])
    out = tmp_path / "mapping.toml"
    assert main(["import", "--guess", str(recording), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"wrote {out}" in printed
    assert "  ? front_axle_m, rear_axle_m: how far is the tracked point from both axles?" in printed
    assert out.read_text(encoding="utf-8").count("# ?") == 2


@pytest.mark.parametrize("case", ["exists", "two", "missing"])
def test_a_bad_request_is_one_line(case, tmp_path, capsys):
    recording = write_csv(tmp_path / "r.csv", written("plain")[0])
    out = tmp_path / "mapping.toml"
    if case == "exists":
        out.write_text("", encoding="utf-8")
    files = {"exists": [recording], "two": [recording, recording], "missing": [tmp_path / "none.csv"]}[case]
    assert main(["import", "--guess", *map(str, files), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    expected = {"exists": "exists already", "two": "a mapping is guessed from one recording: 2", "missing": "none.csv"}
    assert expected[case] in error
    assert error.count("\n") == 1


CELLS = st.floats(-1e9, 1e9) | st.just(math.nan) | st.sampled_from([0.0, 1.0, -1.0, 1500.0])
ROW = st.lists(CELLS, min_size=4, max_size=4)
TABLES = st.fixed_dictionaries(
    {"t": ROW.map(sorted), "x": ROW, "y": ROW, "yaw": ROW, "throttle": ROW, "steer": ROW},
    optional={"time_ms": ROW, "armed": ROW, "tracked": ROW, "rear": ROW, "cmd_w": ROW, "a'\\ü": ROW},
)


@given(table=TABLES)
def test_any_numbers_are_refused_in_one_line_or_make_a_mapping_that_loads(table, tmp_path_factory):
    directory = tmp_path_factory.mktemp("guess")
    cells = {name: ["" if math.isnan(v) else repr(v) for v in column] for name, column in table.items()}
    try:
        mapping, _ = guess_mapping(write_csv(directory / "r.csv", cells))
    except AgvbenchError as error:
        lines = str(error).splitlines()
    else:
        (directory / "m.toml").write_text(mapping, encoding="utf-8")
        lines = [load_mapping(directory / "m.toml").columns.x.column]
    assert len(lines) == 1


def test_a_column_of_true_and_false_says_which_rows_count(tmp_path):
    table, _ = written("plain")
    recording = write_csv(tmp_path / "r.csv", table | {"armed": ["True" if t > 1.0 else "False" for t in table["t_s"]]})
    text, questions = guess_mapping(recording)
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    (run,) = import_recordings(tmp_path / "mapping.toml", [recording], tmp_path / "c")
    assert len(run.frames) == pytest.approx(ROWS - RATE_HZ, abs=2)
    assert "armed: do only rows with true count as driven?" in questions


def test_what_the_supply_was_is_kept_if_it_varies(tmp_path):
    table, _ = written("plain")
    table |= {"Battery [V]": [12.0 - 1e-4 * row for row in range(ROWS)], "logic_voltage": [5.0] * ROWS}
    table |= {"motor_current_A": [0.1 * (row % 7) for row in range(ROWS)]}
    table |= {"battery_current_A": table["motor_current_A"], "Battery (V)": [11.0 + 1e-4 * row for row in range(ROWS)]}
    table |= {"rear_battery_V": table["Battery (V)"], "supply": [math.inf] + [1.0] * (ROWS - 1)}
    table |= {"low_battery": ["true", "false"] * (ROWS // 2), "volts": [math.nan] * ROWS}
    path = write_csv(tmp_path / "drive.csv", table)
    text, _ = guess_mapping(path)
    assert (
        '[logged]\nBattery_V = { column = "Battery [V]" }\nBattery_V_2 = { column = "Battery (V)" }\n'
        'rear_battery_V = { column = "rear_battery_V" }\n\n'
    ) in text
    assert not any(word in text for word in ("logic", "current", "low_battery", "supply", "volts", "rear = "))
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    assert len(next(iter(import_recordings(tmp_path / "mapping.toml", [path], tmp_path / "c"))).logged) == 3


def test_the_unit_in_the_name_of_a_command_is_its_unit(tmp_path):
    table, _ = written("plain")
    table["steering_deg"] = [20.0 * value for value in table.pop("steering")]
    table["speed_cmd (km/h)"] = [3.6 * value for value in table.pop("throttle")]
    recording = write_csv(tmp_path / "r.csv", table)
    text, _ = guess_mapping(recording)
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    campaign = import_recordings(tmp_path / "mapping.toml", [recording], tmp_path / "c")
    (run,) = campaign
    assert campaign.header.channels == Channels.alike("si")
    assert np.abs(run.commands.front).max() == pytest.approx(math.radians(20.0), rel=1e-3)
    assert run.commands.drive.max() == pytest.approx(0.5, rel=1e-3)


def test_an_axle_beyond_a_right_angle_is_asked_about(tmp_path):
    table, _ = written("plain")
    table["steering"] = [20.0 * value for value in table["steering"]]
    _, questions = guess_mapping(write_csv(tmp_path / "r.csv", table))
    assert any(question.startswith("steering: an axle at 20 rad?") for question in questions)


def test_a_decimal_comma_is_guessed_behind_whole_numbers(tmp_path):
    recording = write_csv(tmp_path / "r.csv", written("plain")[0], delimiter=";")
    header, first, *rest = recording.read_text(encoding="utf-8").replace(".", ",").splitlines()
    zeros = ";".join("0" for _ in first.split(";"))
    recording.write_text("\n".join([header, zeros, *rest]) + "\n", encoding="utf-8")
    assert 'decimal = ","' in guess_mapping(recording)[0]
