"""The run to drive next is judged by driving it with a vehicle that knows nothing of the package's model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tiny_vehicle import HEADER, Tiny, drive

from agvbench.diagnosis import conclusion, diagnose
from agvbench.diagnosis.design.alternatives import swapped
from agvbench.diagnosis.design.criteria import predictor_like, simulated_readings
from agvbench.diagnosis.design.designs import Design, designs, levels_of, mutated
from agvbench.diagnosis.design.identifiability import unidentified
from agvbench.diagnosis.design.next_experiment import discriminate, identify, required_measurements
from agvbench.diagnosis.selection.candidates import candidates
from agvbench.model import nominal_model
from agvbench.planning import Workspace, plan, trajectory_from_table
from agvbench.types import Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

GEOMETRY = Geometry(HEADER.front_axle_m, HEADER.rear_axle_m)


@pytest.fixture(scope="module")
def diagnosed():
    """Return a function that diagnoses a tiny vehicle and returns the answer and the selection behind it."""
    from tiny_vehicle import campaign_runs

    known = {}

    def get(tiny, *, steps):
        if (tiny, steps) not in known:
            kept = []
            original = conclusion.with_next_experiment

            def keep(found, selection, *rest):
                kept.append(selection)
                return original(found, selection, *rest)

            conclusion.with_next_experiment = keep
            try:
                runs = campaign_runs(tiny, steps=steps)
                found = diagnose(type("Tinies", (), {"header": HEADER, "__iter__": lambda _: iter(runs)})())
            finally:
                conclusion.with_next_experiment = original
            known[tiny, steps] = found, kept[0]
        return known[tiny, steps]

    return get


@pytest.mark.slow
def test_delay_and_latency_are_not_told_apart_by_any_run_and_it_says_what_would(diagnosed):
    found, _ = diagnosed(Tiny(delay_s=0.1), steps=True)
    named = {found.effects[0].name, *found.effects[0].confounded_with}
    assert named == {"actuation_delay", "mocap_latency"}
    (item,) = found.to_json()["provenance"]["inseparable"]
    assert set(item["between"]) == named
    assert "a time that vehicle and cameras share" in item["needs"]
    assert found.next_experiment is None or not found.next_experiment.separates


@pytest.mark.slow
def test_the_run_that_separates_rivals_does_so_when_it_is_driven(diagnosed):
    truth = Tiny(steering_lag_s=0.15)
    _, selection = diagnosed(truth, steps=False)
    chosen = selection.chosen.fit
    proposal = discriminate(chosen, {"steering_lag": {"axle_coupling": 1.0}}, candidates(GEOMETRY), unit="us")
    experiment = proposal.experiment
    assert experiment is not None
    assert not proposal.inseparable
    trajectory = trajectory_from_table(experiment.to_table()["trajectory"])
    nominal = nominal_model("tiny", GEOMETRY, Channels.alike("us"))
    commands = plan(trajectory, nominal).commands
    rng = np.random.default_rng(5)
    alternative = swapped(chosen, "steering_lag", "axle_coupling", candidates(GEOMETRY))
    missed = {}
    for name, model in (("truth", chosen), ("rival", alternative)):
        squares = []
        for start in experiment.starts:
            frames = drive(truth, commands, start, 0.0, np.random.default_rng(rng.integers(2**31)))
            design = Design(tuple(_steps(commands)), HEADER.neutral)
            predicted = predictor_like(model, simulated_readings([design], [[start]], np.zeros(3)), GEOMETRY)
            poses = predicted.predict(model.parameters)[0]
            at = predicted.readings.t_s[0]
            x, y = np.interp(at, frames.t_s, frames.x_m), np.interp(at, frames.t_s, frames.y_m)
            squares.append(np.mean((x - poses[:, 0]) ** 2 + (y - poses[:, 1]) ** 2))
        missed[name] = math.sqrt(float(np.mean(squares)))
    assert missed["truth"] < 0.25 * missed["rival"]


def _steps(commands):
    for k in range(1, len(commands.t_s) - 1):
        yield (commands.t_s[k + 1] - commands.t_s[k], *commands.at(k))


@pytest.mark.slow
def test_steering_that_never_changes_while_driving_leaves_its_lag_open_and_a_run_pins_it(diagnosed):
    found, selection = diagnosed(Tiny(), steps=False)
    flat = unidentified(selection.chosen.fit, candidates(GEOMETRY))
    assert [item.name for item in flat] == ["steering_lag.time_constant_s"]
    assert found.to_json()["provenance"]["not_identifiable"][flat[0].name].startswith("never excited")
    experiment = found.next_experiment
    assert experiment.pins == ("steering_lag.time_constant_s",)
    fronts = np.diff([row[2] for row in experiment.trajectory.commands.rows[1:]])
    rears = np.diff([row[3] for row in experiment.trajectory.commands.rows[1:]])
    assert np.any(fronts != 0.0) or np.any(rears != 0.0)
    assert identify(selection.chosen.fit, [], unit="us") is None


def test_where_everything_was_excited_nothing_is_proposed(diagnosed):
    found, _ = diagnosed(Tiny(), steps=True)
    assert found.next_experiment is None
    assert "not_identifiable" not in found.provenance, found.provenance["not_identifiable"]


def test_designs_stay_within_known_levels_and_time(diagnosed):
    _, selection = diagnosed(Tiny(), steps=True)
    fit = selection.chosen.fit
    maps = fit.predictor.maps
    levels = levels_of(maps, fit.parameters[: maps.size])
    rng = np.random.default_rng(1)
    tried = designs(levels)
    for design in [*tried, *(mutated(tried[int(rng.integers(len(tried)))], levels, rng) for _ in range(300))]:
        commands = design.commands()
        assert np.all(np.diff(commands.t_s) > 0.0)
        assert commands.t_s[0] == 0.0
        assert commands.t_s[-1] < 11.0
        assert set(commands.drive) <= {*maps.nodes["drive"], HEADER.neutral.drive}
        assert set(commands.front) <= set(maps.nodes["front"])
        assert set(commands.rear) <= set(maps.nodes["rear"])


@pytest.mark.slow
def test_starts_keep_the_run_on_a_small_floor(diagnosed):
    truth = Tiny(steering_lag_s=0.15)
    _, selection = diagnosed(truth, steps=False)
    repeatability = Workspace.circle(2.4, 0.1)
    alternatives = {"steering_lag": {"axle_coupling": 1.0}}
    experiment = discriminate(
        selection.chosen.fit, alternatives, candidates(GEOMETRY), unit="us", workspace=repeatability
    ).experiment
    commands = plan(experiment.trajectory, nominal_model("tiny", GEOMETRY, Channels.alike("us"))).commands
    for start in experiment.starts:
        frames = drive(truth, commands, Pose(*start), 0.0, np.random.default_rng(0))
        assert np.hypot(frames.x_m, frames.y_m).max() < 1.2


def test_required_measurements_is_said_for_any_pair():
    assert "known distance" in required_measurements(("mocap_scale", "lateral_slip"))
    assert required_measurements(("a", "b"))
