"""Hosts put an adapter on the bus. Shared by both kinds: queries, events, the token, and one lock.

The lock is what lets adapters be written without any: whatever a host calls, it calls one at a time.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, TypeVar

from msgspec.structs import replace

from agvbench.adapters.contract import AgvAdapter, MocapAdapter
from agvbench.adapters.thread_failures import report_thread_failures
from agvbench.bus.clock import Clock
from agvbench.bus.counters import Sequence
from agvbench.bus.keys import IDENTITY, TIME, Keys
from agvbench.bus.messages.codec import ENCODING, encode
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity
from agvbench.bus.messages.request import TimeMessage
from agvbench.bus.queries import refusal
from agvbench.errors import AgvbenchError, LinkError

_QUERIES_WAITING = 64


def as_agvbench_error(error: BaseException, role: str) -> AgvbenchError:
    """Return `error` if a user can have caused it, else a `LinkError` that names the fault in the adapter."""
    if isinstance(error, AgvbenchError):
        return error
    return LinkError(f"the {role} adapter failed", value=f"{type(error).__name__}: {error}")


_Identity = TypeVar("_Identity", AgvIdentity, MocapIdentity)


def checked_identity(adapter: AgvAdapter | MocapAdapter, role: str, kind: type[_Identity]) -> _Identity:
    """Return the identity of `adapter`.

    Raises
    ------
    AgvbenchError
        If that fails, or it is not of this kind.
    """
    try:
        identity: object = adapter.identity()
    except Exception as error:
        raise as_agvbench_error(error, role) from error
    if not isinstance(identity, kind):
        remedy = f"return one; agvbench {role} ADAPTER --check says what else is wrong"
        raise LinkError(f"identity is no {kind.__name__}", where=f"{role} adapter", value=repr(identity), remedy=remedy)
    return identity


class Host(ABC):
    """An adapter on the bus, until `close`.

    Parameters
    ----------
    session
        An open Zenoh session.
    keys
        The vehicle's keys.
    role
        ``"agv"`` or ``"mocap"``.
    clock
        The clock that `time` questions are answered in.
    """

    def __init__(self, session: Any, keys: Keys, role: str, clock: Clock) -> None:
        import zenoh

        self._session, self._keys, self._role, self._clock = session, keys, role, clock
        self._zenoh_error = zenoh.ZError
        self._lock = threading.RLock()
        self._events, self._reporting = Sequence(), threading.Lock()
        self._threads: list[threading.Thread] = []
        self._watching = ExitStack()
        self._queryable = session.declare_queryable(
            keys.queryable(role, "*"), zenoh.handlers.FifoChannel(_QUERIES_WAITING)
        )
        self._answers: dict[str, Callable[[bytes], bytes]] = {
            IDENTITY: lambda _: self._identity(),
            TIME: lambda _: encode(TimeMessage(self._clock.now())),
        }

    @abstractmethod
    def _identity(self) -> bytes:
        """Return the identity message."""

    def _announce(self) -> None:
        """Answer queries, then declare the token: a peer that sees it may rely on everything declared before."""
        self._run("questions", self._serve_queries)
        self._token = self._session.liveliness().declare_token(self._keys.alive(self._role))

    def _run(self, name: str, target: Callable[[], None]) -> None:
        thread = threading.Thread(target=target, name=f"agvbench-{self._role}-{name}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _serve_queries(self) -> None:
        # The queryable itself is locked while a thread waits in it; its handler is not.
        handler = self._queryable.handler
        while True:
            try:
                query = handler.recv()
            except self._zenoh_error:
                return
            with query:
                self._answer(query)

    def _answer(self, query: Any) -> None:
        queryable = str(query.key_expr).rpartition("/")[2]
        try:
            answer = self._answers.get(queryable)
            if answer is None:
                raise LinkError("no such question", where=self._role, value=queryable, limit=" ".join(self._answers))
            payload = b"" if query.payload is None else bytes(query.payload.to_bytes())
            query.reply(query.key_expr, answer(payload), encoding=ENCODING)
        except self._zenoh_error:
            return
        except BaseException as error:  # noqa: BLE001  (whatever the adapter raises, the asker must hear of it)
            query.reply_err(refusal(self._role, as_agvbench_error(error, self._role)), encoding=ENCODING)

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Publish an event; also while the adapter hangs."""
        self._publish_event(Event(0, self._role, level, kind, text, acknowledged))

    def failed(self, error: BaseException, *, acknowledged: int = 0) -> None:
        """Report `error` to the runner with all its fields; `acknowledged` is the command that was not carried out."""
        known = as_agvbench_error(error, self._role)
        self._publish_event(Event.of_error(known, self._role, acknowledged=acknowledged))

    def _publish_event(self, event: Event) -> None:
        with self._reporting:
            sequence, t_s = self._events.take(), self._clock.now()
            numbered = replace(event, sequence=sequence, t_s=t_s, source=self._events.source)
            self._put(self._keys.report, encode(numbered))

    def _put(self, key: str, payload: bytes) -> None:
        import zenoh

        try:
            self._session.put(key, payload, encoding=ENCODING, congestion_control=zenoh.CongestionControl.BLOCK)
        except (self._zenoh_error, RuntimeError):
            # The session is closed, or just being closed by another thread: there is no receiver any more.
            return

    def _start_adapter(self, adapter: AgvAdapter | MocapAdapter, start: Callable[[], None]) -> None:
        """Start the adapter, whose threads are watched until it is closed; one that cannot start is closed at once."""
        self._watching.enter_context(report_thread_failures(adapter, self.failed))
        try:
            start()
        except BaseException as error:
            self._watching.close()
            with suppress(Exception):
                if isinstance(adapter, AgvAdapter):
                    adapter.stop()
            with suppress(Exception):
                adapter.close()
            if isinstance(error, Exception):
                raise as_agvbench_error(error, self._role) from error
            raise

    def _close_adapter(self, close: Callable[[], None]) -> None:
        """Release the adapter; what it raises names it."""
        try:
            close()
        except (Exception, SystemExit) as error:
            raise as_agvbench_error(error, self._role) from error
        finally:
            self._watching.close()

    def close(self) -> None:
        """Leave the bus."""
        self._token.undeclare()
        self._queryable.undeclare()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=2.0)
