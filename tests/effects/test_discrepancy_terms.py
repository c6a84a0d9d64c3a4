"""What holds for every discrepancy term, and what those of campaign time do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from effect_checks import check_form, check_null_hooks
from hypothesis import given
from hypothesis import strategies as st

from agvbench.diagnosis.criteria import LOGGED
from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.terms import (
    TERMS,
    ByLoggedColumn,
    DiscrepancyTerm,
    SteeringAtStart,
    TurnByDirection,
    WaveByDistance,
    WheelsByCampaignTime,
)
from agvbench.diagnosis.terms.campaign_time import AT_ONCE_H, ByCampaignTime, course
from agvbench.effects import TIME_HOOKS, effect_kinds
from agvbench.effects import state as s
from agvbench.errors import InputError
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

each_term = pytest.mark.parametrize("term", TERMS, ids=[term.name for term in TERMS])
OF_TIME = [term for term in TERMS if issubclass(term, ByCampaignTime)]
OF_COLUMN = [term for term in TERMS if issubclass(term, ByLoggedColumn)]
WHEN = {"begins_h", "ends_h", "time_constant_h"}
TIMES = np.array([0.0, 1.0, 2.0, 3.0])
COMMANDS = Commands(TIMES, np.array([900.0, 900.0, 2100.0, 1500.0]), np.full(4, 1400.0), np.full(4, 1600.0))
ROWS = np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 0.3], [-0.2, 0.3, 0.3], [0.2, 0.2, -0.3], [0.0, 0.0, 0.0]])


@each_term
def test_it_is_declared_as_an_effect_is(term: type[DiscrepancyTerm]) -> None:
    check_form(term)
    check_null_hooks(term)
    assert term.name not in effect_kinds()
    assert term.covariates
    assert term.through


@pytest.mark.parametrize("term", OF_TIME, ids=[term.name for term in OF_TIME])
@pytest.mark.slow
def test_a_change_holds_in_its_part_of_the_campaign_only(term: type[DiscrepancyTerm]) -> None:
    hours = (0.1, 0.5, 0.9)
    runs = [SimulatedRun(COMMANDS, np.linspace(0.2, 4.0, 40), started_h=h) for h in hours]
    simulation = Simulation(Geometry(0.18, 0.12), NEUTRAL, runs, kinds=(term,))
    nothing = simulation.parameters()
    values = {p.name: p.scale for p in term.parameters()} | {"begins_h": 0.3, "ends_h": 0.7, "time_constant_h": 0.0}
    inside = nothing.copy()
    inside[simulation.indices(term.name)] = list(values.values())
    rows, starts = np.tile(ROWS, (3, 1)), np.tile([0.5, 0.2, 0.3, 0.0], (3, 1))
    moved = np.abs(simulation.predict(rows, inside, starts) - simulation.predict(rows, nothing, starts))
    before, during, after = moved.reshape(3, -1).max(axis=1)
    assert before == after == 0.0
    assert during > 1e-3


@pytest.mark.parametrize("term", OF_COLUMN, ids=[term.name for term in OF_COLUMN])
def test_a_change_is_in_proportion_to_its_column_only(term: type[DiscrepancyTerm]) -> None:
    logged = ((0.0, 0.0, 5.0), (-3.0, 0.01, 0.0), (0.0, 0.02, 5.0), ())
    runs = [SimulatedRun(COMMANDS, np.linspace(0.2, 4.0, 40), logged=values) for values in logged]
    simulation = Simulation(Geometry(0.18, 0.12), NEUTRAL, runs, kinds=(term,))
    nothing = simulation.parameters()
    second = nothing.copy()
    second[simulation.indices(term.name)] = [p.scale for p in term.parameters()]
    rows, starts = np.tile(ROWS, (4, 1)), np.tile([0.5, 0.2, 0.3, 0.0], (4, 1))
    moved = (simulation.predict(rows, second, starts) - simulation.predict(rows, nothing, starts)).reshape(4, -1)
    assert np.all(moved[[0, 3]] == 0.0)
    assert np.abs(moved[1]).max() > 1e-5
    np.testing.assert_allclose(moved[2], 2.0 * moved[1], rtol=0.02, atol=1e-8)


def test_a_weak_motor_bends_the_path_to_the_same_side_forward_and_backward() -> None:
    run = SimulatedRun(COMMANDS, np.linspace(0.2, 5.0, 49))
    geometry = Geometry(0.0, 0.05, kinematics="differential")
    simulation = Simulation(geometry, Command(0.0, 0.0, 0.0), [run], kinds=(TurnByDirection,))
    values = simulation.parameters()
    values[simulation.indices("turn_by_direction")] = 0.2
    speeds = np.array([0.0, 0.3, -0.2, 0.2, 0.0])
    rows = np.column_stack([np.zeros((5, 2)), speeds])
    heading = simulation.predict(rows, values, np.array([[0.5, 0.2, 0.3, 0.0]])).reshape(-1, 3)[:, 2]
    at = np.interp(np.linspace(0.2, 5.0, 49), [0.0, 1.0, 2.0, 3.0, 5.0], [0.0, 0.3, 0.5, 0.7, 0.7])
    np.testing.assert_allclose(heading, 0.3 + 0.2 * at, rtol=0.0, atol=1e-6)


def driven(effect: DiscrepancyTerm, rows: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """Return the headings (K,) of a vehicle with one term under a command per second; `rows` as of the simulation."""
    times = np.arange(len(rows) - 1.0)
    commands = Commands(times, *np.full((3, len(times)), 1600.0))
    # The diagnosis compiles this kernel in any case.
    simulation = Simulation(Geometry(0.2, 0.2), NEUTRAL, [SimulatedRun(commands, t_s)], kinds=EXTENDED_LIBRARY)
    return simulation.predict(rows, simulation.parameters([effect]), np.zeros((1, 4))).reshape(-1, 3)[:, 2]


def test_a_wheel_that_turns_back_passes_the_same_angles_in_reverse_order() -> None:
    wave = WaveByDistance(period_m=0.41, turn_cosine=0.3, turn_sine=0.8)
    speeds = np.array([0.0, 0.5, -0.5, 0.3, -0.3, 0.0])
    heading = driven(wave, np.column_stack([np.zeros((6, 2)), speeds]), np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0]))
    angle = math.tau * 0.25 / 0.41
    there = 0.41 / math.tau * (0.3 * math.sin(angle) + 0.8 * (1.0 - math.cos(angle)))
    np.testing.assert_allclose(heading[[0, 2]], there, atol=1e-6)
    np.testing.assert_allclose(heading[3:], [0.0, heading[4], 0.0], atol=1e-6)
    assert abs(heading[4]) > 0.01


def test_the_axles_turn_less_at_each_start_of_the_drive() -> None:
    weak = SteeringAtStart(loss_s_per_m=0.4, time_constant_s=0.3)
    speeds = np.array([0.0, 0.5, 0.0, 0.5, -0.5, 0.0])
    rows = np.column_stack([np.full((6, 2), [0.02, -0.02]), speeds])
    t_s = np.linspace(0.0, 5.0, 501)[1:]
    lost = (driven(SteeringAtStart(), rows, t_s) - driven(weak, rows, t_s))[[99, 199, 299, 399, 499]]
    # The yaw rate of small angles, times the loss integrated over a second; a reversal is no start from rest.
    whole = 0.5 * 0.04 / 0.4 * 0.4 * 0.5 * 0.3 * -math.expm1(-1.0 / 0.3)
    after = 0.5 * 0.04 / 0.4 * 0.4 * 0.5 * 0.3 * math.exp(-1.0 / 0.3) * -math.expm1(-1.0 / 0.3)
    np.testing.assert_allclose(lost, [whole, whole, 2.0 * whole, 2.0 * whole - after, 2.0 * whole - after], rtol=2e-3)


def test_another_battery_changes_speed_and_yaw_rate_of_both_wheels_alike() -> None:
    run = SimulatedRun(Commands(*np.array([[0.0], [1600.0], [1600.0], [1600.0]])), np.array([1.0, 2.0]), started_h=0.5)
    geometry = Geometry(0.0, 0.0, kinematics="differential")
    simulation = Simulation(geometry, NEUTRAL, [run], kinds=EXTENDED_LIBRARY)
    rows = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.3]])
    for begins_h, factor in ((0.2, 1.25), (0.8, 1.0)):
        change = WheelsByCampaignTime(change=0.25, begins_h=begins_h, ends_h=2.0)
        x, y, heading = simulation.predict(rows, simulation.parameters([change]), np.zeros((1, 4)))[-1]
        turned = 2.0 * 0.4 * factor
        np.testing.assert_allclose(heading, turned, rtol=1e-6)
        np.testing.assert_allclose(math.hypot(x, y), 2.0 * 0.3 / 0.4 * math.sin(0.5 * turned), rtol=1e-6)


def test_more_columns_than_the_simulation_holds_are_refused() -> None:
    assert LOGGED.max_regressors <= s.LOGGED_COUNT
    run = SimulatedRun(COMMANDS, np.linspace(0.2, 4.0, 4), logged=(0.0,) * (s.LOGGED_COUNT + 1))
    with pytest.raises(InputError, match="too many logged values"):
        Simulation(Geometry(0.18, 0.12), NEUTRAL, [run])


@given(hours=st.floats(0.0, 20.0), begin=st.floats(0.0, 5.0), end=st.floats(0.0, 10.0), constant=st.floats(0.0, 6.0))
def test_the_share_of_a_change_is_between_none_and_all(hours, begin, end, constant) -> None:
    share = course(hours, begin, end, constant)
    assert 0.0 <= share <= 1.0
    since = hours if hours < begin else hours - begin
    if hours >= end:
        assert share == 0.0
    elif constant > AT_ONCE_H:
        assert share == pytest.approx(-math.expm1(-since / constant))
    else:
        assert share == float(hours >= begin)


@given(hours=st.floats(0.0, 20.0), begin=st.floats(0.0, 5.0), end=st.floats(0.0, 10.0))
def test_a_step_does_not_change_with_a_small_time_constant(hours, begin, end) -> None:
    """A fit moves along the slope by the time constant: that of a step must be zero, before it and after it."""
    assert course(hours, begin, end, 0.001) == course(hours, begin, end, 0.0)


@pytest.mark.parametrize("term", OF_TIME, ids=[term.name for term in OF_TIME])
def test_hooks_called_as_python_change_the_state_by_the_share(term: type[DiscrepancyTerm]) -> None:
    sizes = [p.scale for p in term.parameters() if p.name not in WHEN]
    for name, hook in term.hooks().items():
        changed = []
        for hours in (0.2, 0.5, 3.0):
            state = np.random.default_rng(7).uniform(0.5, 1.0, s.SIZE)
            state[s.HOURS] = hours
            before = state.copy()
            time_s = (
                hook(state, 1.0, *sizes, 0.3, 2.0, 0.0) if name in TIME_HOOKS else hook(state, *sizes, 0.3, 2.0, 0.0)
            )
            changed.append(np.abs(state - before).max() if time_s is None else abs(time_s - 1.0))
        assert changed[0] == changed[2] == 0.0
        assert changed[1] > 1e-4
