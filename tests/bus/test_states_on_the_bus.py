"""A runner's state between two sessions over loopback, as between two machines: late, slow, hostile and many."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any

import pytest
import zenoh

from agvbench.bus.keys import Keys
from agvbench.bus.messages.codec import ENCODING, encode
from agvbench.bus.messages.runner_state import Phase, RunnerState
from agvbench.bus.session import bus_session
from agvbench.bus.state_follower import StateFollower, find_runners
from agvbench.bus.state_publisher import StatePublisher
from agvbench.errors import AdapterGoneError, LinkError, MessageError

pytestmark = pytest.mark.real_time
KEYS = Keys("lab", "agv1")
SOURCE = 7


class Runner:
    """A runner that only says what it does."""

    def __init__(self, session: Any, keys: Keys = KEYS, period_s: float = 0.02) -> None:
        self.phase, self.made = Phase.STARTING, 0
        self.faults: tuple[str, ...] = ()
        self._token = session.liveliness().declare_token(keys.runner(SOURCE))
        self._publisher = StatePublisher(session, keys, SOURCE, self._state, period_s=period_s)

    def _state(self, sequence: int, source: int) -> RunnerState:
        self.made += 1
        return RunnerState(sequence, source, "monday", "1.0", self.phase, 0.0, 1.0, faults=self.faults)

    def finish(self) -> None:
        self.phase = Phase.FINISHED
        self._publisher.close()
        self._token.undeclare()


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


@pytest.fixture
def endpoint(free_port: Callable[[], int]) -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def bench(stack: ExitStack, endpoint: str) -> Any:
    return stack.enter_context(bus_session(listen=[endpoint]))


@pytest.fixture
def observer(stack: ExitStack, bench: Any, endpoint: str) -> Any:
    return stack.enter_context(bus_session(connect=[endpoint]))


@pytest.fixture
def dying(stack: ExitStack, bench: Any, endpoint: str) -> Any:
    """Return the session of a process that will end without a word."""
    return stack.enter_context(bus_session(connect=[endpoint]))


def until(condition: Callable[[], bool], limit_s: float = 5.0) -> bool:
    end_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.01)
    return condition()


def test_a_late_observer_gets_the_last_state_and_then_every_change(bench: Any, observer: Any) -> None:
    runner = Runner(bench)
    runner.phase = Phase.DRIVING
    time.sleep(0.1)
    (found,) = find_runners(observer, limit_s=5.0).items()
    assert (found[0], found[1].phase, found[1].campaign) == (KEYS, Phase.DRIVING, "monday")
    with StateFollower(observer, *found) as follower:
        states = follower.states(5.0)
        assert next(states) == found[1]
        runner.phase = Phase.SETTLING
        assert next(s for s in states if s is not None and s.phase is Phase.SETTLING).sequence > found[1].sequence
        runner.finish()
        *_, last = states
    assert last is not None
    assert last.phase is Phase.FINISHED


def test_no_state_is_made_without_observers(bench: Any) -> None:
    runner = Runner(bench)
    time.sleep(0.3)
    assert runner.made == 0
    runner.finish()
    assert runner.made == 1


def test_subscriber_and_queries_get_no_more_states_than_the_period_allows(bench: Any, observer: Any) -> None:
    runner = Runner(bench, period_s=0.1)
    with StateFollower(observer, KEYS, find_runners(observer, limit_s=5.0)[KEYS]) as follower:
        assert until(lambda: runner.made > 2)
        began_s, before = time.monotonic(), runner.made
        while time.monotonic() < began_s + 1.0:
            find_runners(observer, limit_s=5.0)
        took_s = time.monotonic() - began_s
        assert runner.made - before <= took_s / 0.09 + 1
        assert follower.malformed == 0
    runner.finish()


def test_a_subscriber_that_takes_nothing_does_not_hold_the_publisher_up(bench: Any, observer: Any) -> None:
    """Its receiving thread of Zenoh is held, as a suspended terminal's is; the runner's sender drops states."""
    held, release = threading.Event(), threading.Event()

    def hold(_: object) -> None:
        held.set()
        release.wait(20.0)

    blocked = observer.declare_subscriber(KEYS.state, hold)
    runner = Runner(bench, period_s=0.001)
    runner.faults = ("x" * 400,) * 8
    assert held.wait(5.0)
    try:
        before = runner.made
        assert until(lambda: runner.made > before + 4000, 20.0), "states are made while nothing is taken"
        began_s = time.monotonic()
        runner.finish()
        assert time.monotonic() - began_s < 1.0
    finally:
        release.set()
        blocked.undeclare()


def test_a_runner_that_vanishes_is_an_error(dying: Any, observer: Any) -> None:
    Runner(dying)
    with StateFollower(observer, KEYS, find_runners(observer, limit_s=5.0)[KEYS]) as follower:
        states = follower.states(5.0)
        next(states)
        dying.close()
        with pytest.raises(AdapterGoneError, match="the bench vanished before it was finished: last seen starting"):
            list(states)


def test_a_runner_that_vanished_before_it_was_followed_is_an_error_too(dying: Any, observer: Any) -> None:
    Runner(dying)
    first = find_runners(observer, limit_s=5.0)[KEYS]
    dying.close()
    time.sleep(0.2)
    with StateFollower(observer, KEYS, first) as follower, pytest.raises(AdapterGoneError):
        list(follower.states(0.3))


def test_silence_is_said(bench: Any, observer: Any) -> None:
    runner = Runner(bench, period_s=60.0)  # as a process that hangs, with its token still there
    with StateFollower(observer, KEYS, find_runners(observer, limit_s=5.0)[KEYS]) as follower:
        states = follower.states(0.3)
        assert [next(states) is None for _ in range(3)] == [False, True, True]
    runner.finish()


def test_nobody_answers(observer: Any) -> None:
    with pytest.raises(LinkError, match=r"agvbench/v2/\*/\*/runner/state: no bench answers: waited 0.3 s; start"):
        find_runners(observer, limit_s=0.3)


def test_a_runner_of_another_version_is_said_to_be_one(bench: Any, observer: Any) -> None:
    key = KEYS.state

    def answer(query: Any) -> None:
        with query:
            query.reply(key, b"\x92\x07\x80", encoding=ENCODING)

    other = bench.declare_queryable(key, answer)
    with pytest.raises(MessageError, match=r"lab/agv1/runner/state: message of another encoding: 7 .* both ends"):
        find_runners(observer, limit_s=0.3)
    other.undeclare()


@pytest.mark.parametrize("payload", [b"", b"noise", bytes(900_000)], ids=["empty", "noise", "long"])
def test_malformed_states_are_counted_and_not_shown(bench: Any, observer: Any, payload: bytes) -> None:
    runner = Runner(bench, period_s=10.0)
    with StateFollower(observer, KEYS, find_runners(observer, limit_s=5.0)[KEYS]) as follower:
        states = follower.states(0.2)
        next(states)
        bench.put(KEYS.state, payload)
        assert next(states) is None
        assert follower.malformed == (1 if payload else 0)
        runner.finish()
        assert [s.phase for s in states if s is not None] == [Phase.FINISHED]


def test_a_state_of_another_sender_on_the_same_key_is_not_taken(bench: Any, observer: Any) -> None:
    runner = Runner(bench, period_s=10.0)
    first = find_runners(observer, limit_s=5.0)[KEYS]
    with StateFollower(observer, KEYS, first) as follower:
        bench.put(KEYS.state, encode(RunnerState(99, SOURCE + 1, "other", "1.0", Phase.FINISHED, 0.0, 0.0)))
        states = follower.states(0.3)
        assert [next(states), next(states)] == [first, None]
    runner.finish()


def test_several_runners_are_found_by_their_names(bench: Any, observer: Any) -> None:
    others = [Keys("lab", "red"), Keys("hall", "red")]
    runners = [Runner(bench, keys) for keys in (KEYS, *others)]
    assert until(lambda: len(find_runners(observer, limit_s=5.0)) == 3)
    assert set(find_runners(observer, limit_s=5.0, vehicle="red")) == set(others)
    assert set(find_runners(observer, limit_s=5.0, lab="lab")) == {KEYS, others[0]}
    with pytest.raises(LinkError, match="name cannot be used on the bus"):
        find_runners(observer, limit_s=0.3, lab="a/**")
    for runner in runners:
        runner.finish()


def test_a_closed_session_ends_the_publisher_quietly(endpoint: str) -> None:
    before = set(threading.enumerate())
    with bus_session(listen=[endpoint]) as session:
        runner = Runner(session)
        session.close()
    with suppress(zenoh.ZError):
        runner.finish()
    assert set(threading.enumerate()) <= before
