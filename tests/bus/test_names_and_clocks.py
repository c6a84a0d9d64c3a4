"""Names on the bus, sequence numbers, clocks and the watchdog."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.bus.clock import Clock, SimulatedClock, WallClock, Watchdog, wait_until
from agvbench.bus.counters import LossCounter, Sequence
from agvbench.bus.keys import Keys
from agvbench.errors import LinkError


@pytest.mark.parametrize("name", ["", "a/b", "*", "**", "a b", "ä", "$*", "a" * 65, "a\n", "#", "?"])
def test_names_that_would_be_other_keys_are_refused(name: str) -> None:
    for keys in ((name, "agv1"), ("lab", name)):
        with pytest.raises(LinkError, match="cannot be used on the bus"):
            Keys(*keys)


def test_every_key_is_one_that_zenoh_takes_and_stays_below_its_vehicle() -> None:
    import zenoh

    keys = Keys("lab-1", "agv_2.b")
    everything = zenoh.KeyExpr(f"{keys.root}/**")
    for key in (
        keys.command,
        keys.report,
        keys.truth,
        keys.alive("agv"),
        keys.queryable("a", "b"),
    ):
        assert everything.includes(zenoh.KeyExpr(key))
    assert len({keys.command, keys.report, keys.truth}) == 3


@given(st.sets(st.integers(0, 98), max_size=60))
def test_every_missing_number_is_counted_once(dropped: set[int]) -> None:
    sequence, counter = Sequence(), LossCounter()
    numbers = [sequence.take() for _ in range(100)]
    for index, number in enumerate(numbers):
        if index not in dropped:
            counter.saw(sequence.source, number)
    first = next(i for i in range(100) if i not in dropped)
    assert counter.lost == sum(index > first for index in dropped)
    assert counter.received == 100 - len(dropped)


def test_a_sender_that_starts_again_is_no_loss() -> None:
    counter = LossCounter()
    for source in (1, 2):
        for number in (1, 2, 3):
            counter.saw(source, number)
    assert (counter.lost, counter.restarts) == (0, 1)


@given(st.floats(0, 1e6), st.floats(-10, 1e4))
@pytest.mark.real_time
def test_a_deadline_is_kept(start_s: float, ahead_s: float) -> None:
    clock = SimulatedClock(start_s)
    late_s = wait_until(clock, start_s + ahead_s)
    assert clock.now() >= start_s + ahead_s
    assert late_s == clock.now() - (start_s + ahead_s)


@pytest.mark.parametrize("clock", [WallClock(), SimulatedClock()])
def test_clocks_do_not_go_back(clock: Clock) -> None:
    before = clock.now()
    clock.sleep(-1.0)
    clock.sleep(0.001)
    assert clock.now() >= before + 0.001


def test_the_watchdog_barks_in_its_own_clock() -> None:
    barked = threading.Event()
    dog = Watchdog(SimulatedClock(), 3600.0, barked.set, period_s=60.0)
    dog.arm()
    assert barked.wait(10.0)
    assert dog.expired
    dog.close()
