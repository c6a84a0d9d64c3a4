"""The simulation against equations written out independently."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from simulation_truth import COMMANDS, FRAMES, LF, LR, REST, RUN_TIMES, SETTLED, SIZES, STARTED_H, true_poses

import agvbench.effects as library
from agvbench.effects import effect_kinds
from agvbench.errors import InputError
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

START = (0.4, -0.3, 0.6)
ROWS = np.vstack([[*REST, 0.0], SETTLED])
INITIAL = np.array([[*START, 0.0]])
RUN = SimulatedRun(
    Commands(RUN_TIMES, 1500.0 + COMMANDS[:, 0], 1500.0 + COMMANDS[:, 1], 1500.0 + COMMANDS[:, 2]), FRAMES, STARTED_H
)
PAIRS = list(itertools.combinations(SIZES, 2))


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(Geometry(LF, LR), NEUTRAL, [RUN])


def parameters(simulation, sizes):
    kinds = effect_kinds()
    return simulation.parameters([kinds[name](**values) for name, values in sizes.items()])


def error(simulation, sizes):
    predicted = simulation.predict(ROWS, parameters(simulation, sizes), INITIAL)
    return np.abs(predicted - true_poses(sizes, START)).max()


def derivatives(simulation, at, effect):
    """Derivatives of the poses with respect to an effect's parameters by differences, one-sided at a bound."""
    made = []
    for i in simulation.indices(effect):
        step = 1e-3 * simulation.scales[i]
        below = np.clip(at[i] - step, simulation.lower[i], None)
        moved = [np.where(np.arange(at.size) == i, value, at) for value in (below, below + step, below + 2.0 * step)]
        low, middle, high = (simulation.predict(ROWS, values, INITIAL) for values in moved)
        one_sided = 2.0 * middle - 1.5 * low - 0.5 * high
        made.append((one_sided if below == at[i] else 0.5 * (high - low)) / step)
    return np.array(made)


def test_there_is_a_truth_for_every_effect_of_the_library():
    exported = {name for name, kind in effect_kinds().items() if kind.__name__ in library.__all__}
    assert exported <= set(SIZES) <= set(effect_kinds())


def test_without_effects(simulation):
    assert error(simulation, {}) < 1e-7


@pytest.mark.parametrize("name", SIZES)
def test_one_effect(simulation, name):
    assert error(simulation, {name: SIZES[name]}) < 2e-6


@pytest.mark.slow
def test_every_pair_of_effects(simulation):
    errors = {pair: error(simulation, {name: SIZES[name] for name in pair}) for pair in PAIRS}
    worst = max(errors, key=errors.__getitem__)
    # A floor tilts only a vehicle that moves: a drift that sets in within 3 mm/s costs most.
    assert errors[worst] < 5e-5, worst
    assert sorted(errors.values())[int(0.9 * len(errors))] < 2e-6


@pytest.mark.parametrize("name", SIZES)
def test_derivatives_with_respect_to_an_effects_parameters(simulation, name):
    at = parameters(simulation, {name: SIZES[name]})
    for column, (parameter, value) in zip(derivatives(simulation, at, name), SIZES[name].items(), strict=True):
        step = 2e-3 * value
        above, below = (true_poses({name: {**SIZES[name], parameter: value + by}}, START) for by in (step, -step))
        expected = (above - below) / (2.0 * step)
        # A pose that is read on a kink has two slopes; hence the quantile.
        assert np.quantile(np.abs(column - expected), 0.99) < 3e-3 * np.abs(expected).max()


@pytest.mark.parametrize("name", SIZES)
def test_a_planted_effect_is_recovered_from_independent_data(simulation, name):
    measured = true_poses({name: SIZES[name]}, START)
    which, planted = simulation.indices(name), np.array(list(SIZES[name].values()))
    at = parameters(simulation, {name: {parameter: 0.7 * value for parameter, value in SIZES[name].items()}})
    for _ in range(8):
        residual = measured - simulation.predict(ROWS, at, INITIAL)
        slopes = derivatives(simulation, at, name)
        at[which] += np.linalg.lstsq(slopes.reshape(len(which), -1).T, residual.ravel(), rcond=None)[0]
    np.testing.assert_allclose(at[which], planted, rtol=2e-4)


@pytest.mark.parametrize("name", ["actuation_delay", "steering_lag", "mocap_latency"])
def test_derivatives_at_null(simulation, name):
    for column, parameter in zip(derivatives(simulation, simulation.parameters(), name), SIZES[name], strict=True):
        null = true_poses({}, START)
        small = true_poses({name: {parameter: 5e-3}}, START)
        expected = (small - null) / 5e-3
        assert np.quantile(np.abs(column - expected), 0.95) < 0.03 * np.abs(expected).max()


def test_moving_the_start_moves_the_poses(simulation):
    at = parameters(simulation, {"speed_lag": SIZES["speed_lag"], "steering_lag": SIZES["steering_lag"]})
    poses = simulation.predict(ROWS, at, INITIAL)
    moved = simulation.predict(ROWS, at, np.add(INITIAL, [1e-2, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(moved - poses, np.broadcast_to([1e-2, 0.0, 0.0], poses.shape), atol=1e-9)
    turned = simulation.predict(ROWS, at, np.add(INITIAL, [0.0, 0.0, 0.3, 0.0]))
    away = (poses[:, 0] - START[0] + 1j * (poses[:, 1] - START[1])) * np.exp(0.3j)
    expected = np.column_stack([START[0] + away.real, START[1] + away.imag, poses[:, 2] + 0.3])
    np.testing.assert_allclose(turned, expected, atol=1e-9)


def test_only_chosen_runs_are_simulated():
    both = Simulation(Geometry(LF, LR), NEUTRAL, [RUN, RUN])
    rows, initial = np.vstack([ROWS, ROWS]), np.vstack([INITIAL, INITIAL])
    first, second = both.split(both.predict(rows, both.parameters(), initial, runs=[1]))
    assert np.isnan(first).all()
    assert np.isfinite(second).all()


def test_a_window_of_a_run_goes_on_where_the_run_was():
    sizes = {name: SIZES[name] for name in ("actuation_delay", "steering_lag", "steering_rate_limit", "speed_lag")}
    sizes |= {name: SIZES[name] for name in ("mocap_latency", "marker_offset", "steering_backlash", "mocap_scale")}
    whole = true_poses(sizes, START)
    for first in (40, 70, 110):
        window = SimulatedRun(RUN.commands, FRAMES[first:], STARTED_H, begins_s=FRAMES[first])
        simulation = Simulation(Geometry(LF, LR), NEUTRAL, [window])
        initial = np.array([[*whole[first], np.nan]])
        predicted = simulation.predict(ROWS, parameters(simulation, sizes), initial)
        np.testing.assert_allclose(predicted, whole[first:], atol=1e-5)


def test_a_window_may_begin_at_another_speed():
    window = SimulatedRun(Commands(*np.array([[0.0], [1500.0], [1500.0], [1500.0]])), FRAMES[10:], begins_s=1.0)
    simulation = Simulation(Geometry(LF, LR), NEUTRAL, [window])
    lag = parameters(simulation, {"speed_lag": {"accelerate_s": 0.3, "brake_s": 0.5}})
    poses = simulation.predict(np.zeros((2, 3)), lag, np.array([[0.0, 0.0, 0.0, 0.4]]))
    rolled = np.where(FRAMES[10:] > 1.0, 0.4 * 0.5 * -np.expm1(-(FRAMES[10:] - 1.0) / 0.5), 0.0)
    np.testing.assert_allclose(poses[:, 0], rolled, atol=2e-6)


def test_effects_and_parameters_are_two_ways_to_say_the_same(simulation):
    effects = (effect_kinds()["steering_lag"](0.2), effect_kinds()["steering_rate_limit"](3.0))
    assert simulation.effects(simulation.parameters(effects)) == effects
    assert simulation.effects(simulation.parameters()) == ()
    assert [simulation.parameter_names[i] for i in simulation.indices("speed_lag")] == [
        "speed_lag.accelerate_s",
        "speed_lag.brake_s",
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t_s": np.array([1.0, 0.5])}, "run 0: t_s[1]: time goes back: 0.5 s after 1 s; sort by time"),
        ({"t_s": np.array([np.nan])}, "run 0: t_s[0]: is not finite: nan"),
        ({"commands": Commands(*np.empty((4, 0)))}, "run 0: a run needs a command; give at least one row"),
    ],
)
def test_bad_runs_are_refused(change, message):
    with pytest.raises(InputError) as caught:
        Simulation(Geometry(LF, LR), NEUTRAL, [dataclasses.replace(RUN, **change)])
    assert str(caught.value) == message


@pytest.mark.parametrize("what", ["parameters", "settled", "initial"])
def test_nan_is_refused(simulation, what):
    arrays = {"settled": ROWS.copy(), "parameters": simulation.parameters(), "initial": INITIAL.copy()}
    arrays[what].flat[0] = np.nan
    with pytest.raises(InputError, match=rf"^{what}: is not a number: NaN$"):
        simulation.predict(**arrays)


def test_absurd_numbers_do_not_hang(simulation):
    settled = np.where(ROWS == 0.0, 0.0, [np.pi / 2, -np.pi / 2, 0.3])
    kinds = effect_kinds()
    lags = simulation.parameters([kinds["steering_lag"](1e-12), kinds["speed_lag"](1e-300, 0.0)])
    assert simulation.predict(settled, lags, INITIAL).shape == (len(FRAMES), 3)
