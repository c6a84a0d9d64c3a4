"""``agvbench sim``, ``agv`` and ``mocap``: adapters as their own process, until a signal ends it."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.node import host_adapters
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.session import bus_session, is_open_to_anybody

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_POLL_S = 0.1


def run_adapters(
    options: AdapterOptions,
    *,
    agv: str | None,
    mocap: str | None,
    lab: str,
    listen: Sequence[str],
    connect: Sequence[str],
    bus_config: str | None = None,
) -> int:
    """Host adapters until SIGINT, SIGTERM or SIGHUP; stop the vehicle first, then leave the bus.

    Raises
    ------
    AgvbenchError
        If an endpoint, a name, an adapter or its plant, or the bus's configuration cannot be used.
    """
    config = BusConfig.load(bus_config) if bus_config else None
    _warn_of_remote_access(listen, config)
    with (
        stop_signal() as stopped,
        bus_session(listen=listen, connect=connect, allow_remote=True, config=config) as session,
        host_adapters(session, lab, options, agv=agv, mocap=mocap),
    ):
        what = " and ".join(f"{role} {spec}" for role, spec in (("agv", agv), ("mocap", mocap)) if spec is not None)
        where = " ".join([*(f"listens on {e}" for e in listen), *(f"connected to {e}" for e in connect)])
        print(f"ready: {what} of {lab}/{options.vehicle}, {where}; stop with Ctrl-C", flush=True)
        while not stopped:
            time.sleep(_POLL_S)
    say_stopped()
    return 0


def _warn_of_remote_access(listen: Sequence[str], config: BusConfig | None) -> None:
    for endpoint in listen:
        if is_open_to_anybody(endpoint, config, "--listen"):
            print(
                f"warning: whoever reaches {endpoint} can drive the vehicle; nobody is asked who they are",
                file=sys.stderr,
            )


def say_stopped() -> None:
    """Say that everything is stopped, unless the terminal that would be told is what was closed."""
    with suppress(OSError):
        print("stopped", flush=True)


@contextmanager
def stop_signal() -> Iterator[list[int]]:
    """Give the list that SIGINT, SIGTERM and SIGHUP are added to, in place of what they do.

    Under ``nohup`` SIGHUP stays ignored. The list is to be looked at again and again: the kernel may deliver a signal
    to another thread, which does not wake one that waits in the main thread, and a handler that took a lock could wait
    for the code that it interrupted.
    """
    stopped: list[int] = []
    hung_up = signal.getsignal(signal.SIGHUP)
    taken = [number for number in _SIGNALS if number != signal.SIGHUP or hung_up is not signal.SIG_IGN]
    before = {number: signal.signal(number, lambda caught, _: stopped.append(caught)) for number in taken}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
