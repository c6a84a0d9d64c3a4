"""The prior of the maps: straight maps cost nothing, kinks little, and neighbouring commands belong to one map."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_selector import selector_of
from tiny_vehicle import NEUTRAL, NEUTRAL_COMMAND, InMemory, Tiny, campaign_runs, drive

from agvbench.diagnosis import diagnose
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.diagnosis.model.smoothness import SmoothnessPrior, typical_speed_mps
from agvbench.types import Commands, Pose, Run

NODES = np.array([1000.0, 1150.0, 1300.0, 1312.0, 1400.0, 1600.0, 1700.0, 1850.0, 2000.0])
MAPS = NodalMaps(dict.fromkeys(ROLES, NODES), NEUTRAL_COMMAND)


@pytest.fixture(scope="module")
def prior():
    return SmoothnessPrior.of(MAPS, read_runs(campaign_runs(Tiny())))


def servo(command):
    return -0.0015 * (command - NEUTRAL) - 0.02


def values(front=servo, rear=servo, speed=lambda command: 5e-4 * (NEUTRAL - command)):
    return np.concatenate([each(NODES) for each in (front, rear, speed)])


def test_the_typical_speed_is_near_the_top_speed():
    assert typical_speed_mps(read_runs(campaign_runs(Tiny()))) == pytest.approx(0.32, rel=0.05)


@given(offset=st.floats(-0.1, 0.1), slope=st.floats(-0.003, 0.003), backward=st.floats(1e-4, 1e-3))
def test_straight_maps_cost_nothing_whatever_their_slope_in_either_direction(prior, offset, slope, backward):
    straight = values(
        lambda command: offset + slope * (command - NEUTRAL),
        speed=lambda command: np.where(command < NEUTRAL, 5e-4, backward) * (NEUTRAL - command),
    )
    assert prior.loss(straight) == pytest.approx(0.0, abs=1e-9)


def test_an_end_stop_costs_less_than_the_same_bend_at_every_node(prior):
    stop = prior.loss(values(lambda command: np.maximum(servo(command), -0.35)))
    jagged = prior.loss(values() + np.r_[0.01 * (-1.0) ** np.arange(9), np.zeros(18)])
    assert 1.0 < stop < 20.0 < jagged


def test_a_deviation_costs_more_between_near_commands(prior):
    def deviating(node):
        return prior.loss(values() + np.where(np.arange(27) == node, np.radians(0.5), 0.0))

    assert deviating(3) > 3.0 * deviating(1)


@given(seed=st.integers(0, 1000), size=st.floats(1e-4, 0.1))
def test_the_gradient_is_minus_half_the_derivative_of_the_loss(prior, seed, size):
    rng = np.random.default_rng(seed)
    parameters = np.r_[values() + size * rng.normal(size=27), 0.3, 7.0]
    terms, along = prior.terms(parameters), rng.normal(size=29)
    step = 1e-6
    slope = (prior.loss(parameters + step * along) - prior.loss(parameters - step * along)) / (2.0 * step)
    assert -2.0 * terms.gradient @ along == pytest.approx(slope, rel=1e-3, abs=1e-3)
    assert np.all(np.linalg.eigvalsh(terms.information) > -1e-6 * np.abs(terms.information).max())
    assert not terms.gradient[27:].any()
    assert not terms.information[27:].any()


def _at_levels_of_their_own(run: Run, tiny: Tiny, rng: np.random.Generator) -> Run:
    """Return a backward run that steers by 12 µs more than forward ones do."""
    c, f = run.commands, run.frames
    if not np.any(c.drive > NEUTRAL):
        return run
    commands = Commands(c.t_s, c.drive, c.front + 12.0, c.rear + 12.0)
    start = Pose(float(f.x_m[0]), float(f.y_m[0]), float(f.heading_rad[0]))
    return dataclasses.replace(run, commands=commands, frames=drive(tiny, commands, start, run.started_s, rng))


@pytest.mark.slow
def test_the_prior_shows_a_steering_gain_of_backward_runs_at_commands_of_their_own():
    tiny, rng = Tiny(reverse_gain=-0.05), np.random.default_rng(5)
    runs = [_at_levels_of_their_own(run, tiny, rng) for run in campaign_runs(tiny)]
    selector = selector_of(runs)
    base = selector.base()
    larger = selector.with_effect(base, "reverse_steering_gain")
    assert float(base.fit.loss.sum() - larger.fit.loss.sum()) < 12.0  # the nodal values absorb nearly all of it
    assert larger.gain_over(base) > 50.0
    assert larger.fit.effect_values()["reverse_steering_gain.gain"] == pytest.approx(-0.05, abs=0.01)


@pytest.mark.slow
def test_a_drive_that_coasts_at_neutral_only():
    tiny, rng = Tiny(accelerate_s=0.08, brake_s=0.05, coast_s=0.35), np.random.default_rng(6)
    runs = campaign_runs(tiny)
    for k, levels in enumerate(([900.0, 1350.0, 900.0], [2100.0, 1650.0, 2100.0], [900.0, 1400.0, 1200.0]) * 3):
        commands = Commands(
            np.array([0.0, 0.4, 1.9, 3.4, 4.9]), np.r_[NEUTRAL, levels, NEUTRAL],
            np.full(5, 1600.0), np.full(5, 1400.0),
        )  # fmt: skip
        started_s = 3600.0 * (k + 0.5) / 9.0
        frames = drive(tiny, commands, Pose(*rng.uniform(-0.7, 0.7, 2), 0.3), started_s, rng)
        run = dataclasses.replace(runs[0], run_id=f"speeds-{k}", experiment="step", started_s=started_s)
        runs.append(dataclasses.replace(run, commands=commands, frames=frames))
    found = diagnose(InMemory(runs))
    (speed_lag,) = found.effects
    assert speed_lag.name == "speed_lag"
    coast = speed_lag.parameters["coast_s"]
    assert coast.value == pytest.approx(0.35, abs=max(3.0 * coast.stderr, 0.02))
