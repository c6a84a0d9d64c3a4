"""What a campaign would take, and the command that shows it."""

import json
from dataclasses import replace

import pytest

from agvbench.cli import main
from agvbench.effects import SpeedLag
from agvbench.planning import Workspace, corrected_plan, dry_run, load_trajectory, plan


def test_a_dry_run_adds_up(nominal, calibrated):
    trajectories = [load_trajectory(name) for name in "15"]
    made = dry_run(trajectories, {"uncalibrated": nominal, "calibrated": calibrated}, repeats=10, between_runs_s=30.0)
    durations = [plan(t, model).duration_s for t in trajectories for model in (nominal, calibrated)]
    assert made.runs == 40
    assert made.driving_s == pytest.approx(10.0 * sum(durations))
    assert made.total_s == pytest.approx(made.driving_s + 40 * 30.0)
    assert made.floor_m == pytest.approx((2.302 + 0.5, 1.195 + 0.5), abs=0.01)


def test_conditions_that_a_trajectory_has_not_are_left_out(nominal, calibrated):
    models = {"uncalibrated": nominal, "calibrated": calibrated}
    made = dry_run([load_trajectory("3")], models)
    assert [row.condition for row in made.rows] == ["calibrated"]


def test_what_cannot_be_driven_is_listed_and_not_counted(nominal):
    made = dry_run(
        [load_trajectory("1"), load_trajectory("5")], {"calibrated": nominal}, workspace=Workspace.circle(2.5)
    )
    assert [row.plan is None for row in made.rows] == [True, False]
    assert made.runs == 1
    assert "does not fit" in str(made.problems[0])


def test_a_dry_run_of_nothing_is_nothing(nominal):
    made = dry_run([], {"calibrated": nominal})
    assert (made.runs, made.total_s, made.floor_m) == (0, 0.0, (0.0, 0.0))


def test_plan_shows_a_table(capsys):
    assert main(["plan", "5", "3"]) == 0
    out = capsys.readouterr().out
    assert "1.00 1.00 90°" in out
    assert out.rstrip().splitlines()[-1].startswith("3 runs: ")


def test_plan_gives_json(capsys):
    assert main(["plan", "6", "--json", "--condition", "calibrated", "--repeats", "2"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["total"]["runs"] == 2
    row = answer["rows"][0]
    assert (row["trajectory"], row["condition"], row["problem"]) == ("6", "calibrated", None)
    assert row["target"] == pytest.approx({"x_m": 1.0, "y_m": -1.0, "heading_rad": -1.5707963})


def test_plan_gives_commands_that_can_be_read_again(capsys, nominal):
    assert main(["plan", "5", "--commands", "--condition", "uncalibrated"]) == 0
    header, *rows = capsys.readouterr().out.splitlines()
    assert header == "trajectory,condition,t_s,drive,front,rear"
    expected = plan(load_trajectory("5"), nominal).commands
    table = [[float(cell) for cell in row.split(",")[2:]] for row in rows]
    assert table == [pytest.approx([t, *expected.at(i)], rel=1e-5) for i, t in enumerate(expected.t_s)]


def test_plan_steers_as_asked(capsys):
    assert main(["plan", "5", "--steering", "front", "--condition", "calibrated"]) == 0
    assert "0.87 1.11 90°" in capsys.readouterr().out


def test_plan_shows_the_rest_when_one_cannot_be_driven(capsys):
    assert main(["plan", "1", "5", "--workspace", "circle:2.5"]) == 2
    captured = capsys.readouterr()
    assert "1.00 1.00 90°" in captured.out
    assert captured.err.count("does not fit") == 1


def test_what_is_corrected_is_planned_as_a_bench_would(calibrated):
    lagging = replace(calibrated, effects=(SpeedLag(0.2, 0.3),))
    made = dry_run([load_trajectory("1")], {"calibrated": lagging, "corrected": lagging})
    durations = {row.condition: row.plan.duration_s for row in made.rows}
    assert durations["corrected"] == corrected_plan(load_trajectory("1"), lagging).duration_s
    assert durations["corrected"] != pytest.approx(durations["calibrated"], abs=0.01)


def planned(capsys, *arguments):
    """Return duration [s] and target of trajectory 5 by condition."""
    assert main(["plan", "5", "--json", *arguments]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return {row["condition"]: (row["duration_s"], row["target"]["y_m"]) for row in rows}


def test_a_vehicle_is_planned_with_its_own_nominal_speed_and_steering(
    capsys, tmp_path, monkeypatch, nominal, front_steered
):
    monkeypatch.chdir(tmp_path)
    fast = replace(nominal, drive=replace(nominal.drive, output_low=-0.64, output_high=0.64))
    fast.save("fast.toml")
    slow, quick = planned(capsys), planned(capsys, "--vehicle=fast.toml")
    assert quick["uncalibrated"][0] - 0.5 == pytest.approx((slow["uncalibrated"][0] - 0.5) / 2.0, rel=1e-6)
    fast.save("vehicle.toml")
    assert planned(capsys) == quick
    front_steered.save("vehicle.toml")
    assert planned(capsys)["uncalibrated"][1] == pytest.approx(planned(capsys, "--steering=front")["uncalibrated"][1])
    assert planned(capsys)["uncalibrated"][1] > 1.05


def test_plan_skips_what_the_vehicle_is_not_made_for(capsys, tmp_path, front_steered):
    front_steered.save(tmp_path / "front.toml")
    assert main(["plan", f"--vehicle={tmp_path / 'front.toml'}"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(": ")[1:3] for line in lines] == [["skipped", "crab"], ["skipped", "pulses"]]


def test_plan_of_a_named_trajectory_fails_where_the_vehicle_is_not_made_for_it(capsys, tmp_path, front_steered):
    front_steered.save(tmp_path / "front.toml")
    assert main(["plan", "crab", "5", f"--vehicle={tmp_path / 'front.toml'}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        "crab: segments[0]: moving at 20.0° to the heading needs 20.0° at the rear axle, which does not steer" in line
    )


def test_plan_of_all_fails_where_the_floor_is_too_small(capsys, tmp_path, front_steered):
    front_steered.save(tmp_path / "front.toml")
    assert main(["plan", f"--vehicle={tmp_path / 'front.toml'}", "--workspace=circle:2.9"]) == 2
    assert "does not fit" in capsys.readouterr().err
