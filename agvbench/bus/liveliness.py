"""Liveliness of adapters: tokens on the bus, so that one that vanishes is noticed at once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from agvbench.bus.clock import Clock
from agvbench.bus.keys import AGV, MOCAP, Keys
from agvbench.errors import AdapterGoneError

SETTLES_S = 0.1
"""How long [s] the tokens of adapters that vanish together take to do so."""


class Liveliness:
    """Watches the liveliness tokens of a vehicle's adapters.

    Parameters
    ----------
    session
        The Zenoh session.
    keys
        The vehicle's keys.
    clock
        Real time: adapters vanish in it, simulated or not.
    on_gone
        Called, in a thread of Zenoh, whenever a token vanishes.
    """

    def __init__(self, session: Any, keys: Keys, clock: Clock, on_gone: Callable[[], None] = lambda: None) -> None:
        self._session, self._keys, self._clock, self._on_gone = session, keys, clock, on_gone
        self._present: dict[str, bool] = {}
        self._gone_since_s: dict[str, float] = {}
        self._arrived = threading.Event()
        self._subscriber = session.liveliness().declare_subscriber(keys.alive("*"), self._changed, history=True)

    def _changed(self, sample: Any) -> None:
        import zenoh

        role = str(sample.key_expr).rpartition("/")[2]
        if role not in (AGV, MOCAP):
            return
        if sample.kind == zenoh.SampleKind.PUT:
            self._present[role] = True
            self._gone_since_s.pop(role, None)
            self._arrived.set()
            return
        self._present[role] = False
        self._gone_since_s[role] = self._clock.now()
        self._on_gone()

    def has(self, role: str) -> bool:
        """Whether the adapter in this role is there now."""
        return self._present.get(role, False)

    def wait_for(self, role: str, limit_s: float) -> None:
        """Wait until the adapter in this role is there.

        Raises
        ------
        AdapterGoneError
            If it does not turn up within `limit_s` [s].
        """
        deadline_s = self._clock.now() + limit_s
        while not self.has(role):
            self._arrived.clear()
            left_s = deadline_s - self._clock.now()
            if not (self.has(role) or (left_s > 0.0 and self._clock.wait(self._arrived, left_s))):
                raise AdapterGoneError(
                    f"no {role} adapter on the bus",
                    where=self._keys.root,
                    value=f"waited {limit_s:g} s",
                    remedy=f"start 'agvbench {role}' or 'agvbench sim' for this lab and vehicle, or check the names",
                )

    def check(self, *roles: str, settles_s: float = 0.0) -> None:
        """Raise `AdapterGoneError`, with its name and since when, if an adapter in one of these roles vanished.

        With a process, the tokens of those that are connected through it vanish, too, in any order: a caller that can
        wait for `settles_s` [s] gets the first of `roles`.
        """
        if not self._gone_since_s:
            return
        self._clock.sleep(settles_s)
        for role in roles:
            if (since_s := self._gone_since_s.get(role)) is not None:
                gone_s = self._clock.now() - since_s
                raise AdapterGoneError(
                    f"the {role} adapter vanished",
                    where=self._keys.root,
                    value=f"{gone_s:.1f} s ago",
                    remedy="start it again, or continue its process if that was suspended; "
                    "the run that was being driven does not count",
                )

    def close(self) -> None:
        """Stop watching."""
        self._subscriber.undeclare()
