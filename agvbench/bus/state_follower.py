"""The states of runners, as another process sees them: which there are, what each does, and when it ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import islice
from typing import Any, Self

from agvbench.bus.keys import Keys, of_state, state_keys
from agvbench.bus.messages.runner_state import Phase, RunnerState, decode_runner_state
from agvbench.errors import AdapterGoneError, LinkError, MessageError

_ASK_PERIOD_S = 0.2
_MOST_RUNNERS = 64
_LAST_WORDS_S = 1.0
"""How long [s] the last state of a runner may arrive after its liveliness token has vanished."""


def find_runners(
    session: Any, *, limit_s: float, lab: str | None = None, vehicle: str | None = None
) -> dict[Keys, RunnerState]:
    """Return the states of all runners, or of those of a lab or vehicle, by the keys of their vehicles.

    They are asked again and again until one answers: a bench may just be starting.

    Raises
    ------
    LinkError
        If none answers within `limit_s` [s], or a name cannot be used.
    MessageError
        If one answers and none can be understood, as that of another version.
    """
    asked = state_keys(lab, vehicle)
    end_s = time.monotonic() + limit_s
    while True:
        states, why = _ask(session, asked, max(_ASK_PERIOD_S, end_s - time.monotonic()))
        if states:
            return states
        if time.monotonic() > end_s:
            raise why or LinkError(
                "no bench answers", where=asked, value=f"waited {limit_s:g} s",
                remedy="start 'agvbench bench' with --listen or --connect, and check endpoint and names",
            )  # fmt: skip
        time.sleep(_ASK_PERIOD_S)


def _ask(session: Any, asked: str, limit_s: float) -> tuple[dict[Keys, RunnerState], MessageError | None]:
    """Return the states that answer a query, and why others could not be understood."""
    import zenoh

    states: dict[Keys, RunnerState] = {}
    why = None
    # A lab has fewer runners than are read here; further answers of a flood are not.
    handler: Any = zenoh.handlers.FifoChannel(_MOST_RUNNERS)
    replies = session.get(asked, handler, timeout=limit_s, target=zenoh.QueryTarget.ALL)
    for reply in islice(replies, _MOST_RUNNERS):
        if reply.ok is None:
            continue  # Zenoh itself, at the end of its time
        key = str(reply.ok.key_expr)
        try:
            states[of_state(key)] = decode_runner_state(bytes(reply.ok.payload.to_bytes()))
        except MessageError as error:
            why = MessageError(error.what, where=key, value=error.value, limit=error.limit, remedy=error.remedy)
    return states, why


class StateFollower:
    """Follows the runner of `keys` from its state `first` on, while the context lasts.

    Of what arrives only the last message is kept, undecoded, so that a flood takes no memory.
    """

    def __init__(self, session: Any, keys: Keys, first: RunnerState) -> None:
        self._keys, self._last, self._payload = keys, first, b""
        self.malformed = 0
        """How many messages could not be decoded."""
        self._has_token = False
        self._arrived, self._gone = threading.Event(), threading.Event()
        self._subscribers = (
            session.declare_subscriber(keys.state, self._received),
            session.liveliness().declare_subscriber(keys.runner(first.source), self._token_changed, history=True),
        )

    def _received(self, sample: Any) -> None:
        self._payload = bytes(sample.payload.to_bytes())
        self._arrived.set()

    def _token_changed(self, sample: Any) -> None:
        import zenoh

        if sample.kind == zenoh.SampleKind.PUT:
            self._has_token = True
        else:
            self._gone.set()
            self._arrived.set()

    def states(self, limit_s: float) -> Iterator[RunnerState | None]:
        """Yield every state as it arrives, the first at once, and at last the one that says that it is finished.

        None is yielded where nothing arrived for `limit_s` [s]: the runner hangs, or the network does.

        Raises
        ------
        AdapterGoneError
            If the runner vanished without saying that it has finished.
        """
        yield self._last
        silent_s = time.monotonic() + limit_s
        while self._last.phase is not Phase.FINISHED:
            self._arrived.wait(max(0.0, silent_s - time.monotonic()))
            self._arrived.clear()
            is_silent = time.monotonic() >= silent_s  # also where what arrives is of no use
            if (state := self._next()) is not None:
                yield state
            elif self._gone.is_set() or (is_silent and not self._has_token):
                yield self._last_words()
            elif is_silent:
                yield None
            else:
                continue
            silent_s = time.monotonic() + limit_s

    def _next(self) -> RunnerState | None:
        """Return what arrived, if it is newer than the last state of this runner."""
        payload, self._payload = self._payload, b""
        if not payload:
            return None
        try:
            state = decode_runner_state(payload)
        except MessageError:
            self.malformed += 1
            return None
        if state.source != self._last.source or state.sequence <= self._last.sequence:
            return None
        self._last = state
        return state

    def _last_words(self) -> RunnerState:
        end_s = time.monotonic() + _LAST_WORDS_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._arrived.wait(left_s)
            self._arrived.clear()
            if (state := self._next()) is not None and state.phase is Phase.FINISHED:
                return state
        raise AdapterGoneError(
            "the bench vanished before it was finished", where=self._keys.root,
            value=f"last seen {self._last.phase}, {self._last.elapsed_s:.0f} s after it began",
            remedy="look at its terminal and its network; continue it there with --resume",
        )  # fmt: skip

    def close(self) -> None:
        """Follow no longer."""
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
