"""``agvbench report`` and ``agvbench compare`` as they are called."""

import dataclasses
import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from conftest import TWO
from report_samples import make_campaign

import agvbench
from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter
from agvbench.cli import main
from agvbench.running.configuration.settings import BenchSettings
from agvbench.types import Commands
from agvbench.vehicle.channels import Channels


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Return three campaigns: two nights alike, and one whose vehicle drives 80 mm too far."""
    folder = tmp_path_factory.mktemp("nights")
    make = {"repeats": 8, "rate_hz": 30.0, "trajectories": TWO, "conditions": ("calibrated",), "calibration": False}
    return (
        make_campaign(folder / "monday", seed=1, **make),
        make_campaign(folder / "tuesday", seed=2, **make),
        make_campaign(folder / "broken", seed=3, extra_mm=80.0, **make),
    )


def run(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return code, " ".join(said.out.split()), said.err


def test_report_writes_into_the_campaign_and_prints_a_summary(campaigns, capsys):
    directory = campaigns("eight trajectories")
    code, out, err = run(capsys, "report", directory)
    assert (code, err) == (0, "")
    assert (directory / "report" / "report.html").exists()
    assert "Calibration changed the median end position error from" in out
    assert out.count("End position error: distance of the end position from the target position") == 1
    assert "1_forward" in out


def test_report_into_another_directory_without_recording(campaigns, tmp_path, capsys):
    assert run(capsys, "report", campaigns("free driving"), "--out", tmp_path / "r", "--no-recording")[0] == 0
    assert (tmp_path / "r" / "report.html").exists()
    assert not (tmp_path / "r" / "campaign.rrd").exists()


def test_hostile_names_do_not_reach_the_terminal(campaigns, tmp_path, capsys):
    _, out, _ = run(capsys, "report", campaigns("hostile names"), "--out", tmp_path, "--no-recording")
    assert "\x1b" not in out
    assert "\u202e" not in out


def test_nights_alike_are_no_regression(nights, capsys):
    code, out, err = run(capsys, "compare", nights[0], nights[1])
    assert (code, err) == (0, "")
    assert "No regression shown: of 6 comparisons 0 worse" in out
    assert "Each side is one session" in out


def test_a_vehicle_that_drives_too_far_is_a_regression(nights, capsys, tmp_path):
    code, out, _ = run(capsys, "compare", nights[0], nights[2], "--json", tmp_path / "c.json")
    assert code == 1
    assert "Regression: of 6 comparisons" in out
    made = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert made["regression"] is True
    worse = {d["trajectory"] for d in made["differences"] if d["verdict"] == "worse"}
    assert worse == {"1_forward", "6_forward_right", "all trajectories"}
    shift = next(d for d in made["differences"] if d["trajectory"] == "1_forward" and d["unit"] == "mm")
    assert shift["interval"]["low"] < 80.0 < shift["interval"]["high"] + 10.0


@pytest.mark.parametrize(
    ("order", "fail_on", "code"),
    [((0, 2), "never", 0), ((2, 0), "regression", 0), ((2, 0), "any", 1), ((0, 2), "regression", 1)],
)
def test_when_to_fail(nights, capsys, order, fail_on, code):
    assert run(capsys, "compare", nights[order[0]], nights[order[1]], "--fail-on", fail_on)[0] == code


def test_a_margin_wider_than_the_difference_makes_no_regression(nights, capsys):
    code, out, _ = run(capsys, "compare", nights[0], nights[2], "--margin-mm", "200", "--margin-deg", "10")
    assert code == 0
    assert "6 the same within the margin" in out


def test_conditions_inside_one_campaign(campaigns, capsys):
    code, out, _ = run(capsys, "compare", campaigns("eight trajectories"), "--conditions", "calibrated", "uncalibrated")
    assert code == 1
    assert "uncalibrated against calibrated" in out


def test_too_few_repeats_are_exit_code_2_and_said(tmp_path, capsys):
    make = {"repeats": 2, "rate_hz": 30.0, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a, b = (make_campaign(tmp_path / name, seed=seed, calibration=False, **make) for seed, name in enumerate("ab"))
    code, out, _ = run(capsys, "compare", a, b)
    assert code == 2
    assert "Could not compare: 2 repeats cannot show any difference here, however large; 5 of each could." in out


def test_separate_calibrations_are_said(tmp_path, capsys):
    make = {"repeats": 8, "rate_hz": 30.0, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a, b = (make_campaign(tmp_path / name, seed=seed, **make) for seed, name in enumerate("ab"))
    warning = "The calibrations differ"
    assert warning not in run(capsys, "compare", a, b)[1]
    text = (b / "vehicle.toml").read_text(encoding="utf-8")
    (b / "vehicle.toml").write_text(text.replace("neutral = 1500.0", "neutral = 1510.0"), encoding="utf-8")
    said = run(capsys, "compare", a, b, "--json", tmp_path / "c.json")[1]
    assert warning in said
    hashes = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))["calibrations"]
    assert len(set(hashes)) == 2
    assert all(whole not in said and whole[:12] in said for whole in hashes)


@pytest.mark.parametrize(("columns", "shown"), [(80, 3), (100, 5), (140, 5)])
def test_a_comparison_is_as_wide_as_columns_says_and_folds_no_name(columns, shown, campaigns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    main(["compare", str(campaigns("eight trajectories")), "--conditions", "uncalibrated", "calibrated"])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    assert any(line.split()[0] == "6_forward_right" for line in lines if line.strip())
    numbers = next(line for line in lines if "position [mm]" in line)
    assert len(re.findall(r"\d+\.\d\d", numbers)) == shown


@pytest.fixture
def copies(nights, tmp_path):
    """Return copies of the nights, and of their writers."""
    made = [shutil.copytree(night, tmp_path / night.name) for night in nights]
    return made, [CampaignWriter.resume(path, CampaignHeader.load(path / "campaign.toml")) for path in made]


def changed(path, **values):
    header = dataclasses.replace(CampaignHeader.load(path / "campaign.toml"), **values)
    header.save(path / "campaign.toml")


@pytest.mark.parametrize(("judged", "code"), [(1, 3), (2, 1)])
def test_an_incomplete_campaign_is_said_first_and_is_no_success(judged, code, copies, capsys, tmp_path):
    paths, writers = copies
    done = writers[judged].finished_ids
    writers[judged].write_table("planned", pd.DataFrame({"run_id": [*done, "again", "never"]}))
    writers[0].write_table("planned", pd.DataFrame({"run_id": writers[0].finished_ids}))
    run_of = next(iter(Campaign.open(paths[judged])))
    rejected = dataclasses.replace(run_of, run_id="again-attempt2", status="rejected: lost")
    writers[judged].append(rejected)
    found, out, _ = run(capsys, "compare", paths[0], paths[judged], "--json", tmp_path / "c.json")
    assert found == code
    assert run(capsys, "compare", paths[0], paths[judged], "--fail-on", "never")[0] == 0
    assert out.startswith(f"{paths[judged]} is incomplete: 18 runs planned, 16 driven, 2 missing")
    assert "(1 of them rejected): again, never;" in out
    assert json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))["complete"] is False


def test_vehicles_of_different_units_are_compared_on_purpose_only(nights, capsys, tmp_path):
    night = Campaign.open(nights[1])
    writer = CampaignWriter.create(
        tmp_path / "c", dataclasses.replace(night.header, channels=Channels.alike("normalised", 1500.0))
    )
    for each in night:
        still = np.zeros(len(each.commands))
        writer.append(dataclasses.replace(each, commands=Commands(each.commands.t_s, still, still, still)))
    for options, code in (([], 3), (["--across-vehicles"], 0)):
        found, out, _ = run(capsys, "compare", nights[0], writer.path, *options)
        assert found == code
        assert out.startswith("The vehicles take commands in different units (us and normalised)")


def test_what_differs_between_the_sides_is_said_first(copies, capsys):
    paths, writers = copies
    changed(paths[1], rear_axle_m=0.2, mocap_rate_hz=60.0)
    for writer, digest in zip(writers, "abc", strict=True):
        rows = {"input": ["trajectory 1", "trajectory 2"], "file": ["1.toml", "2.toml"], "sha256": ["same", digest]}
        writer.write_table("inputs", pd.DataFrame(rows))
    BenchSettings(mocap="natnet:lab").save(paths[0])
    BenchSettings(steering="crab").save(paths[1])
    code, out, _ = run(capsys, "compare", paths[0], paths[1])
    assert code == 0
    assert "The vehicles differ: rear_axle_m 0.121 m and 0.2 m." in out
    assert "The cameras differ: rate 120 Hz and 60 Hz, --mocap natnet:lab and sim." in out
    assert "The files of trajectories differ: 2." in out
    assert out.index("The trajectories were steered differently: --steering none and crab.") < out.index("worst first")


HIDDEN = "agvbench.simulator.hidden:steering_lag"
SAMPLED = "The simulated vehicles differ: {} samples another vehicle for each seed (--seed 0 and 1)."


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ({"plant": HIDDEN}, {"plant": HIDDEN, "seed": 1}, SAMPLED.format(HIDDEN)),
        (
            {"plant": "agvbench.simulator:random_plant"},
            {"plant": "agvbench.simulator:random_plant", "seed": 1},
            SAMPLED.format("agvbench.simulator:random_plant"),
        ),
        ({"plant": HIDDEN}, {"plant": "my.py:cart"}, f"The vehicles differ: --plant {HIDDEN} and my.py:cart."),
        ({"agv": "simavr"}, {"seed": 1}, "The vehicles differ: --agv simavr and sim."),
    ],
)
def test_other_plants_and_sampled_vehicles_are_noted_by_command_and_python_alike(copies, capsys, one, other, said):
    paths, _ = copies
    for path, options in zip(paths, (one, other), strict=False):
        BenchSettings(**options).save(path)
    code, out, _ = run(capsys, "compare", paths[0], paths[1])
    assert code == 0
    assert said in out
    notes = agvbench.compare(*paths[:2]).notes
    assert notes[0].startswith(said)
    assert all(" ".join(note.split()) in out for note in notes)


@pytest.mark.parametrize("plant", ["agvbench.simulator:make_plant", "my.py:cart"])
def test_another_seed_of_one_vehicle_is_another_evening_without_a_note(copies, plant):
    paths, _ = copies
    for seed, path in enumerate(paths):
        BenchSettings(plant=plant, seed=seed).save(path)
    (note,) = agvbench.compare(*paths[:2]).notes
    assert note.startswith("Each side is one session")


def test_another_name_is_another_vehicle(copies):
    paths, _ = copies
    changed(paths[1], vehicle_name="truck")
    assert agvbench.compare(*paths[:2]).notes[0] == "The vehicles differ: name thesis AGV and truck."


def test_notes_in_python_tell_separate_calibrations(tmp_path):
    make = {"repeats": 8, "rate_hz": 30.0, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a, b = (make_campaign(tmp_path / name, seed=seed, **make) for seed, name in enumerate("ab"))
    text = (b / "vehicle.toml").read_text(encoding="utf-8")
    (b / "vehicle.toml").write_text(text.replace("neutral = 1500.0", "neutral = 1510.0"), encoding="utf-8")
    compared = agvbench.compare(a, Campaign.open(b))
    assert compared.notes[0].startswith("The calibrations differ")
    assert "The calibrations differ" in compared._repr_html_()
