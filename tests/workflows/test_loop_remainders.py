"""What is learned of a first session: biases that stand out, and no scatter."""

import math

import numpy as np
import pytest

from agvbench.effects import SteeringLag
from agvbench.loop.corrections import bias_corrections, plans_of, shrunken_mean
from agvbench.model import thesis_vehicle
from agvbench.planning import Departure, corrected_plan, load_trajectory
from agvbench.planning.end_pose_prediction import coasting_path
from agvbench.planning.trajectories.loading import trajectory_file
from agvbench.types import Frames, Pose, Run

START = Pose(0.4, -0.3, 0.7)
REST_S = 0.5


def errors_left(bias_sds, n=10, draws=4000):
    """Root mean square of what is left of a bias after learning it from n repeats of standard deviation 1."""
    rng = np.random.default_rng(3)
    learned = [shrunken_mean(bias_sds + rng.standard_normal((n, 1)))[0] for _ in range(draws)]
    return float(np.sqrt(np.mean((bias_sds - np.array(learned)) ** 2)))


@pytest.mark.parametrize("bias_sds", [0.0, 0.3, 1.0, 5.0, -20.0])
def test_what_is_left_is_hardly_more_than_the_standard_error(bias_sds):
    assert errors_left(bias_sds) < 1.25 / np.sqrt(10)


def test_where_there_is_no_bias_less_is_learned_than_the_mean_says():
    assert errors_left(0.0) < 0.75 / np.sqrt(10)


def test_a_large_bias_is_learned_whole():
    values = 40.0 + np.random.default_rng(1).standard_normal((10, 3))
    np.testing.assert_allclose(shrunken_mean(values), values.mean(axis=0), rtol=1e-3)


class Driven:
    """A campaign of one run, as `bias_corrections` takes it, three times over."""

    def __init__(self, run):
        self.runs = [run] * 3

    def __iter__(self):
        return iter(self.runs)

    def select(self, *, condition):
        assert condition == "corrected"
        return self.runs


def as_the_model_says(model, commands, target):
    """Return a run that ends where the model says, after a rest at neutral as the bench makes it."""
    path = coasting_path(model, commands, Departure(START))
    path = np.vstack([np.c_[np.linspace(-REST_S, -0.02, 25), np.zeros((25, 3))], path])
    way = (path[:, 1] + 1j * path[:, 2]) * np.exp(1j * START.heading_rad) + complex(START.x_m, START.y_m)
    n = len(path)
    heading = np.array([math.remainder(START.heading_rad + turned, math.tau) for turned in path[:, 3]])
    nan = np.full(n, np.nan)
    frames = Frames(path[:, 0], way.real, way.imag, heading, np.ones(n, np.bool_), np.arange(n), nan, nan)
    return Run("1", "trajectory", "5", "corrected", 1, target, 0.0, "ok", "sim", commands, frames)


def test_a_vehicle_that_does_what_the_model_says_leaves_nothing_to_learn():
    model = thesis_vehicle().with_effects(SteeringLag(0.4))
    made = corrected_plan(load_trajectory("5"), model, departure=Departure(START))
    left = bias_corrections(Driven(as_the_model_says(model, made.commands, made.target)), model, "corrected")["5"]
    assert [1e3 * left["x_m"], 1e3 * left["y_m"]] == pytest.approx([0.0, 0.0], abs=0.1)
    assert math.degrees(left["heading_rad"]) == pytest.approx(0.0, abs=0.02)


def test_plans_are_told_by_the_name_that_their_runs_have(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text(trajectory_file("garage").read_text().replace('"garage"', '"my_garage"'))
    left = {"my_garage": Pose(0.02, 0.0, 0.0)}
    said = plans_of(thesis_vehicle(), "circle:20", left, (str(mine), "figure_eight", "3"))
    assert list(said) == ["my_garage", "figure_eight", "3"]
    assert said["my_garage"]["remainder"]["along_mm"] == 20.0
    assert max(abs(said[name]["remaining"]["along_mm"]) for name in ("my_garage", "figure_eight")) < 0.5


def test_no_plan_is_made_of_a_trajectory_that_is_not_driven_corrected(tmp_path):
    calm = tmp_path / "calm.toml"
    calm.write_text('conditions = ["calibrated"]\n' + trajectory_file("garage").read_text())
    assert plans_of(thesis_vehicle(), "circle:20", names=(str(calm),)) == {}


def test_what_is_said_of_a_plan_before_it_is_driven_is_of_the_plan_that_is_driven():
    model = thesis_vehicle().with_effects(SteeringLag(0.4))
    said = plans_of(model, "circle:20", names=("5",))["5"]
    driven = corrected_plan(load_trajectory("5"), model).correction
    assert said["uncorrected"]["delta_heading_deg"] == pytest.approx(
        math.degrees(driven.uncorrected.delta_heading_rad), abs=1e-3
    )
