"""``agvbench watch``: one runner on a bus, and the states in which it is seen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from agvbench.bus.bus_config import BusConfig
from agvbench.bus.keys import Keys
from agvbench.bus.messages.runner_state import RunnerState
from agvbench.bus.session import bus_session
from agvbench.bus.state_follower import StateFollower, find_runners
from agvbench.errors import FlagError, LinkError

SILENT_S = 3.0
"""After so long [s] without a state the view says so: a runner publishes at least four a second."""
_LONGEST_WAIT_S = 3600.0


@dataclass(frozen=True)
class Watched:
    """A runner by its names, and its states; None where none arrived for `SILENT_S`."""

    keys: Keys
    states: Iterator[RunnerState | None]

    @property
    def name(self) -> str:
        """Lab and vehicle."""
        return f"{self.keys.lab}/{self.keys.vehicle}"


@contextmanager
def watched_states(
    endpoint: str,
    *,
    bus_config: str | None = None,
    lab: str | None = None,
    vehicle: str | None = None,
    wait_s: float = 5.0,
    once: bool = False,
) -> Iterator[Watched]:
    """Find the runner that is meant and follow it while the context lasts; `once`: its state now, alone.

    Raises
    ------
    FlagError
        If several runners could be meant, or the time to wait is out of range.
    LinkError
        If nothing listens at `endpoint`, or no runner answers.
    """
    if not 0.0 < wait_s <= _LONGEST_WAIT_S or not math.isfinite(wait_s):
        limit = f"above 0 s, at most {_LONGEST_WAIT_S:g} s"
        raise FlagError("value cannot be used", where="--wait", value=f"{wait_s:g} s", limit=limit)
    config = BusConfig.load(bus_config) if bus_config else None
    with ExitStack() as stack:
        with _naming_the_remedy(endpoint):
            session = stack.enter_context(bus_session(connect=[endpoint], timeout_s=wait_s, config=config))
        runners = find_runners(session, limit_s=wait_s, lab=lab, vehicle=vehicle)
        keys = _chosen(runners)
        if once:
            yield Watched(keys, iter([runners[keys]]))
            return
        follower = stack.enter_context(StateFollower(session, keys, runners[keys]))
        yield Watched(keys, follower.states(SILENT_S))


@contextmanager
def _naming_the_remedy(endpoint: str) -> Iterator[None]:
    """Where nothing listens, say that a bench is missing: other commands look for adapters there."""
    try:
        yield
    except LinkError as error:
        if error.what != "no answer":
            raise
        remedy = f"start 'agvbench bench --listen {endpoint}' there, or correct the endpoint"
        raise LinkError("nothing listens", where=error.where, value=error.value, remedy=remedy) from None


def _chosen(runners: dict[Keys, RunnerState]) -> Keys:
    if len(runners) > 1:
        found = ", ".join(sorted(f"{keys.lab}/{keys.vehicle}" for keys in runners))
        remedy = "choose one with --vehicle-name, or with --lab too"
        raise FlagError("several benches are running", where="agvbench watch", value=found, remedy=remedy)
    return next(iter(runners))
