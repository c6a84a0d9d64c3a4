"""Threads simulate runs as one does, to the last bit, and an error in one of them is raised."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest
from simulation_truth import COMMANDS, FRAMES, LF, LR, REST, RUN_TIMES, SETTLED, SIZES

from agvbench.effects import effect_kinds
from agvbench.model.simulation import threads
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

pytest.importorskip("numba")

RUNS = 100
NEUTRAL = Command(1500.0, 1500.0, 1500.0)
COMMANDED = Commands(RUN_TIMES, *(1500.0 + COMMANDS.T))


@pytest.fixture
def with_threads(monkeypatch):
    def use(count: int) -> None:
        monkeypatch.setattr(threads, "thread_count", lambda: count)
        threads._pool.cache_clear()

    yield use
    threads._pool.cache_clear()


def poses(chosen=None):
    """Return the poses of runs that differ in their start, with every effect of the library and a memory in some."""
    simulation = Simulation(Geometry(LF, LR), NEUTRAL, [SimulatedRun(COMMANDED, FRAMES, 0.01 * k) for k in range(RUNS)])
    kinds = effect_kinds()
    values = simulation.parameters([kinds[name](**SIZES[name]) for name in SIZES])
    settled = np.tile(np.vstack([[*REST, 0.0], SETTLED]), (RUNS, 1))
    initial = np.column_stack([np.random.default_rng(1).normal(size=(RUNS, 3)), np.zeros(RUNS)])
    return simulation.predict(settled, values, initial, runs=chosen)


@pytest.mark.parametrize("chosen", [None, np.arange(1, RUNS, 2), np.arange(20)])
def test_any_number_of_threads_predicts_the_same(with_threads, chosen):
    with_threads(1)
    alone = poses(chosen)
    assert np.isfinite(alone[: len(FRAMES)]).all() == (chosen is None or 0 in chosen)
    for count in (2, 3, 8):
        with_threads(count)
        np.testing.assert_array_equal(poses(chosen), alone)


def test_several_threads_share_the_runs(with_threads):
    with_threads(3)
    barrier, seen = threading.Barrier(3, timeout=30.0), []

    def simulate(runs):
        barrier.wait()  # passes only if three threads are here at once
        seen.extend(runs.tolist())

    threads.in_threads(simulate, np.arange(50))
    assert sorted(seen) == list(range(50))


def test_few_runs_wake_no_thread(with_threads):
    with_threads(8)
    names = []
    threads.in_threads(lambda _: names.append(threading.current_thread()), np.arange(10))
    assert names == [threading.current_thread()]


@pytest.mark.parametrize("where", [0, 1])
def test_an_error_in_any_thread_is_raised_when_all_have_ended(with_threads, where):
    with_threads(2)
    ended = []

    def simulate(runs):
        ended.append(runs[0])
        if runs[0] == where:
            raise ValueError(f"share {where}")

    with pytest.raises(ValueError, match=f"share {where}"):
        threads.in_threads(simulate, np.arange(40))
    assert sorted(ended) == [0, 1]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_threads_of_its_own(with_threads):
    with_threads(2)
    threads.in_threads(lambda _: None, np.arange(40))
    child = os.fork()
    if child == 0:
        threads.in_threads(lambda _: None, np.arange(40))  # waits for ever on threads that were not copied
        os._exit(7)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
