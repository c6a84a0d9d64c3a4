"""The firmware in real time: how well it keeps up with the clock, and how soon pulses stop when its host is killed.

The host is a process of its own with the adapter for serial ports, which drives the simulated microcontroller through
its pseudo-terminal and says its command every 0.1 s, as a runner has it done. It gets SIGKILL at a random moment; what
is measured on the machine's clock is the time from there to the end of the first neutral drive pulse. The firmware has
been hearing nothing for up to 0.1 s by then.

``--kills N`` (default 10); needs ``nox -s firmware``.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import time

from firmware_needed import exit_code

from agvbench.adapters.simavr.host import CYCLES_PER_S, Pulse, SimavrHost

NEUTRAL_US, DRIVEN_US, TOLERANCE_US = 1500.0, 1700.0, 10.0
LISTENED_S, GIVEN_UP_S = 5.0, 2.0
WATCHDOG_MS, WATCHDOG_TOLERANCE_MS, KEEP_ALIVE_MS = 250.0, 25.0, 100.0
HOST = f"""
import sys, time
from agvbench.adapters import AdapterOptions
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.bus.messages.command import CommandMessage
from agvbench.types import Command

agv = SerialAgv.open(sys.argv[1], AdapterOptions())
for number in range(1, 1000):
    agv.apply(CommandMessage(number, 0.0, Command({DRIVEN_US}, 1500.0, 1500.0), 0.1))
    time.sleep({KEEP_ALIVE_MS} / 1e3)
"""


def pulses_on_time(version: str) -> tuple[float, float]:
    """Return how long [s] of the microcontroller's time passes in a second, and how late [ms] a pulse is at worst."""
    host, lags = SimavrHost(version, live=True), []
    first: tuple[float, int] | None = None
    for pulse in host.pulses():
        now = time.monotonic()
        first = first or (now, pulse.fall)
        lags.append((now - first[0]) - (pulse.fall - first[1]) / CYCLES_PER_S)
        if now - first[0] > LISTENED_S:
            break
    host.process.terminate()
    host.close()
    return (LISTENED_S - lags[-1] + lags[0]) / LISTENED_S, 1e3 * (max(lags) - min(lags))


def is_near(pulse: Pulse, width_us: float) -> bool:
    """Whether this is a drive pulse of about this width; version 1 rounds to whole degrees."""
    return pulse.channel == 0 and abs(pulse.width_us - width_us) <= TOLERANCE_US


def stopped_after_ms(version: str, luck: random.Random) -> float | None:
    """Kill a host that drives; return the time [ms] to the first neutral pulse, None if none came for two seconds."""
    microcontroller = SimavrHost(version, live=True)
    pulses = microcontroller.pulses()
    with subprocess.Popen([sys.executable, "-c", HOST, microcontroller.port]) as host:  # noqa: S603  (our own program)
        next(pulse for pulse in pulses if is_near(pulse, DRIVEN_US) or host.poll() is not None)
        if host.poll() is not None:
            sys.exit("the host has ended by itself")
        kill_s = time.monotonic() + 0.3 + luck.uniform(0.0, 0.1)
        next(pulse for pulse in pulses if time.monotonic() > kill_s)
        killed_s = time.monotonic()
        host.kill()
    found = None
    for pulse in pulses:
        now = time.monotonic()
        if is_near(pulse, NEUTRAL_US):
            found = 1e3 * (now - killed_s)
        if found is not None or now - killed_s > GIVEN_UP_S:
            break
    microcontroller.process.terminate()
    microcontroller.close()
    return found


def row(what: str, figures: str, bound: str = "", met: bool | None = None) -> None:
    """Print a row."""
    print(f"{what:52s} {figures:40s} {bound:16s} {'' if met is None else 'yes' if met else 'no'}", flush=True)


def killed(version: str, kills: int) -> None:
    """Print when pulses stop; only version 2 has a watchdog."""
    luck = random.Random(4)  # noqa: S311  (phases, not secrets)
    what, times = (
        f"firmware {version}: host killed, neutral after",
        [stopped_after_ms(version, luck) for _ in range(kills)],
    )
    known = [one for one in times if one is not None]
    if not known:
        return row(what, f"never (watched for {GIVEN_UP_S:g} s, {kills} kills)")
    low, high = WATCHDOG_MS - WATCHDOG_TOLERANCE_MS - KEEP_ALIVE_MS, WATCHDOG_MS + WATCHDOG_TOLERANCE_MS
    met = len(known) == kills and all(low <= one <= high for one in known)
    return row(
        what, f"{min(known):.0f} to {max(known):.0f} ms ({len(known)} kills)", f"{low:.0f} to {high:.0f} ms", met
    )


def main() -> int:
    """Print everything; return 2 where the firmware is not built."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--kills", type=int, default=10, metavar="N")
    arguments, _ = parser.parse_known_args()

    def measure() -> None:
        for version in ("1", "2"):
            pace, late_ms = pulses_on_time(version)
            row(f"firmware {version}: its seconds in a second", f"{pace:.5f}, pulses late by up to {late_ms:.1f} ms")
        killed("1", 2)
        killed("2", max(2, arguments.kills))

    return exit_code(measure)


if __name__ == "__main__":
    sys.exit(main())
