"""What the firmware does with commands: how late, how exactly, how mixed; and how fast the simulated one runs.

Commands that change all channels are given at random phases of the servo frame to both versions, in a simulated
microcontroller. A command's delay on a channel runs from its first bit on the wire to the falling edge of the first
pulse that it made: what a servo can know. The whole loop (bus, serial protocol, firmware, plant, camera packets) is
timed beside the same rig without firmware, in turns.

``--commands N`` (default 1000); needs ``nox -s firmware``.
"""

from __future__ import annotations

import argparse
import random
import statistics
import sys
import time

import numpy as np
from firmware_needed import exit_code

from agvbench.adapters import open_rig
from agvbench.adapters.simavr.host import CYCLES_PER_S, Pulse
from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.types import Command, Pose

CHANNELS = ("drive", "front", "rear")
NEUTRAL = Command(1500.0, 1500.0, 1500.0)
BLOCKS, DRIVEN_S = 7, 10.0


def commands(count: int) -> list[Command]:
    """Return commands that change every channel, of whole degrees."""
    return [Command(*(1180.0 + 80.0 * ((index + shift) % 8) for shift in (0, 3, 6))) for index in range(count)]


def respond(version: str, given: list[Command]) -> tuple[np.ndarray, np.ndarray, float]:
    """Return delays [ms] (n, 3), errors of widths [µs] (n, 3), and the share of commands that a frame mixes."""
    luck, microcontroller = random.Random(1), Microcontroller(version)  # noqa: S311  (phases, not secrets)
    delays, errors, mixed = [], [], 0
    for command in given:
        said_s = microcontroller.now_s
        microcontroller.set_command(command)
        pulses = microcontroller.run_until(said_s + 0.06 + luck.uniform(0.0, 0.02))
        first = [_first(pulses, channel, wanted) for channel, wanted in enumerate(command)]
        delays.append([1e3 * (pulse.fall / CYCLES_PER_S - said_s) for pulse in first])
        errors.append([pulse.width_us - wanted for pulse, wanted in zip(first, command, strict=True)])
        mixed += max(pulse.rise for pulse in first) - min(pulse.rise for pulse in first) > 0.01 * CYCLES_PER_S
    microcontroller.close()
    return np.array(delays), np.array(errors), mixed / len(given)


def _first(pulses: list[Pulse], channel: int, wanted_us: float) -> Pulse:
    return next(pulse for pulse in pulses if pulse.channel == channel and abs(pulse.width_us - wanted_us) < 5.0)


def watchdog_ms(repeats: int) -> list[float]:
    """Return the times [ms] from a command to the first neutral pulse's beginning, at random phases."""
    luck, microcontroller, found = random.Random(2), Microcontroller("2"), []  # noqa: S311
    for _ in range(repeats):
        microcontroller.run_until(microcontroller.now_s + luck.uniform(0.0, 0.02))
        said_s = microcontroller.now_s
        microcontroller.set_command(Command(1800.0, 1500.0, 1500.0))
        drives = [pulse for pulse in microcontroller.run_until(said_s + 0.4) if pulse.channel == 0]
        last = max(pulse.rise for pulse in drives if pulse.width_us > 1700.0)
        found.append(1e3 * (min(pulse.rise for pulse in drives if pulse.rise > last) / CYCLES_PER_S - said_s))
    microcontroller.close()
    return found


def row(what: str, figures: str, bound: str = "", met: bool | None = None) -> None:
    """Print a row."""
    print(f"{what:44s} {figures:42s} {bound:12s} {'' if met is None else 'yes' if met else 'no'}", flush=True)


def responses(count: int) -> None:
    """Print delays, errors, mixed frames and the watchdog."""
    row("what", "min / quartiles / max, sd", "bound")
    for version in ("1", "2"):
        delays, errors, mixed = respond(version, commands(count))
        for channel, name in enumerate(CHANNELS):
            low, first, middle, third, high = np.percentile(delays[:, channel], (0, 25, 50, 75, 100))
            figures = (
                f"{low:5.1f} / {first:5.1f} {middle:5.1f} {third:5.1f} / {high:5.1f}, {delays[:, channel].std():.2f} ms"
            )
            row(f"firmware {version}: delay of {name}", figures)
        spread = np.ptp(delays, axis=1)
        row(f"firmware {version}: first to last channel", f"{spread.min():.1f} to {spread.max():.1f} ms")
        row(f"firmware {version}: frames that mix commands", f"{100 * mixed:.1f} % of {count}")
        worst = float(np.abs(errors).max())
        row(f"firmware {version}: width off the command", f"worst {worst:.2f} µs", "≤ 1 µs", worst <= 1.0)
    bites = watchdog_ms(max(20, count // 10))
    met = all(abs(bite - 250.0) <= 25.0 for bite in bites)
    row("firmware 2: watchdog", f"{min(bites):.1f} to {max(bites):.1f} ms", "250 ± 25 ms", met)


def driven(agv: str, mocap: str) -> float:
    """Return how much faster than real time a rig drives."""
    with open_rig(agv=agv, mocap=mocap) as link:
        link.reset(Pose(0.0, 0.0, 0.0), run_key="speed")
        began, t_s = time.perf_counter(), 0.0
        for index in range(int(DRIVEN_S / 0.5)):
            link.control_cycle(NEUTRAL._replace(drive=1600.0 + index), t_s=t_s, hold_s=0.5)
            t_s += 0.5
        return DRIVEN_S / (time.perf_counter() - began)


def speed() -> None:
    """Print how fast the whole loop is beside the rig without firmware."""
    rigs = [("simavr", "natnet:emulated"), ("sim", "natnet:emulated"), ("simavr", "sim"), ("sim", "sim")]
    for rig in rigs:
        driven(*rig)  # what is compiled or cached is so from here on
    blocks = [[driven(*rig) for rig in rigs] for _ in range(BLOCKS)]
    for (agv, mocap), column in zip(rigs, zip(*blocks, strict=True), strict=True):
        times, whole = statistics.median(column), (agv, mocap) == rigs[0]
        row(f"{agv} seen by {mocap}", f"{times:.0f} × real time", "≥ 20 ×" * whole, times >= 20.0 if whole else None)


def main() -> int:
    """Print everything; return 2 where the firmware is not built."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--commands", type=int, default=1000, metavar="N")
    arguments, _ = parser.parse_known_args()

    def measure() -> None:
        responses(max(10, arguments.commands))
        speed()

    return exit_code(measure)


if __name__ == "__main__":
    sys.exit(main())
