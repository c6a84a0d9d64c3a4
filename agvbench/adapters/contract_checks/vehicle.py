"""Checks of an AGV adapter that do not move the vehicle: it is opened, identifies itself, stops and is closed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from agvbench.adapters.contract import AdapterOptions, AgvAdapter
from agvbench.adapters.contract_checks.result import CheckFailedError, CheckResult, call, run_check
from agvbench.adapters.registry import check_agv, open_agv
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.identity import AgvIdentity, decode_agv_identity
from agvbench.bus.messages.truth import TruthFlags
from agvbench.types import Floats


class _Reports:
    """Keeps the first error that the adapter reports."""

    def __init__(self) -> None:
        self.error: Exception | None = None

    def truth(
        self, t_s: Floats, poses: Floats, *, end_s: float, acknowledged: int = 0, flags: int = TruthFlags.LAST
    ) -> None:
        """Leave true poses."""

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Leave an event."""

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        """Keep the error."""
        self.error = self.error or error


def check_vehicle(spec: str, options: AdapterOptions) -> Iterator[CheckResult]:
    """Check the AGV adapter `spec`; give one result after another. No command but that to stop is sent.

    Raises
    ------
    AgvbenchError
        If there is no such adapter.
    """
    check_agv(spec)
    opened: list[AgvAdapter] = []
    yield (result := run_check("open", lambda: _open(spec, options, opened)))
    if not result.passed:
        return
    (vehicle,), reports = opened, _Reports()
    try:
        for name, check in _checks(vehicle, reports, options):
            yield run_check(name, check)
    finally:
        run_check("stop", lambda: str(call("stop", vehicle.stop)))
        closed = run_check("close", lambda: _close(vehicle))
    yield closed


def _open(spec: str, options: AdapterOptions, opened: list[AgvAdapter]) -> str:
    opened.append(call("open", lambda: open_agv(spec, options)))
    return f"{type(opened[0]).__name__} is opened"


def _checks(vehicle: AgvAdapter, reports: _Reports, options: AdapterOptions) -> Iterator[tuple[str, Callable[[], str]]]:
    yield "identity", lambda: _identity(vehicle, options)
    yield "start", lambda: _start(vehicle, reports)
    yield "stop", lambda: _stop(vehicle, reports)


def _identity(vehicle: AgvAdapter, options: AdapterOptions) -> str:
    identity: object = call("identity", vehicle.identity)
    if not isinstance(identity, AgvIdentity):
        raise CheckFailedError(f"identity returns {identity!r}", "return AgvIdentity(vehicle=options.vehicle, …)")
    if decode_agv_identity(encode(identity)) != identity:
        raise CheckFailedError(f"{identity} changes on the bus", "use texts, numbers and booleans only")
    if call("identity", vehicle.identity) != identity:
        raise CheckFailedError("identity changes from one call to the next", "return the same as long as it is open")
    if identity.vehicle != options.vehicle:
        raise CheckFailedError(f"vehicle is called {identity.vehicle!r}", "return options.vehicle")
    commands = f"commands in {identity.channels}"
    return f"{identity.vehicle} ({identity.firmware}), {commands}"


def _start(vehicle: AgvAdapter, reports: _Reports) -> str:
    call("start", lambda: vehicle.start(reports))
    return "returns"


def _stop(vehicle: AgvAdapter, reports: _Reports) -> str:
    call("stop", vehicle.stop)
    call("stop", vehicle.stop)
    if reports.error is not None:
        raise reports.error
    return "before any command, and again"


def _close(vehicle: AgvAdapter) -> str:
    call("close", vehicle.close)
    return "after stop"
