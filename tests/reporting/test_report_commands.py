"""``agvbench report`` and ``agvbench compare`` as they are called."""

import json

import pytest
from conftest import TWO
from report_samples import make_campaign

from agvbench.cli import main


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
    assert "No regression shown: of 9 comparisons 0 worse" in out
    assert "Each side is one session" in out


def test_a_vehicle_that_drives_too_far_is_a_regression(nights, capsys, tmp_path):
    code, out, _ = run(capsys, "compare", nights[0], nights[2], "--json", tmp_path / "c.json")
    assert code == 1
    assert "Regression: of 9 comparisons" in out
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
    assert "9 the same within the margin" in out


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
    warning = "The sides were calibrated separately"
    assert warning not in run(capsys, "compare", a, b)[1]
    text = (b / "vehicle.toml").read_text(encoding="utf-8")
    (b / "vehicle.toml").write_text(text.replace("neutral = 1500.0", "neutral = 1510.0"), encoding="utf-8")
    assert warning in run(capsys, "compare", a, b)[1]
