"""Single rides of `firmware_vehicle` behind the firmware, without bus and camera: the end pose to the last digit.

What a whole campaign takes a minute for, a sweep of the servo frame's phase takes seconds for here.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from firmware_vehicle import make_plant

from agvbench.adapters.agv.simavr import KEEP_ALIVE_S
from agvbench.adapters.serial_line.lines import encode_line
from agvbench.adapters.simavr.host import CYCLES_PER_S, Pulse
from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.types import Command, Commands, Floats

FRAME_S, SETTLE_S = 0.02, 0.4
LONGEST_SEGMENT_S = 9.0


class Rides:
    """Rides from (0, 0, 0) with one version of the firmware; close it after the last."""

    def __init__(self, version: str = "2") -> None:
        self._controller = Microcontroller(version)
        self._plant = make_plant(0)

    def ends(self, commands: Commands, phases: int, *, on_board: bool = False) -> Floats:
        """Return end poses (phases, 3) [m, m, rad] of rides that begin at as many phases, evenly over a frame.

        `commands` are sent by the host as their times come, or, `on_board`, as timed segments before the first begins.
        """
        ride = self._on_board if on_board else self._from_host
        return np.array([self._ride(ride(commands), FRAME_S * (k + 0.5) / phases) for k in range(phases)])

    def close(self) -> None:
        """End the simulated microcontroller."""
        self._controller.close()

    def _ride(self, said: list[tuple[float, list[bytes | Command]]], phase_s: float) -> Floats:
        """Say each of the lines or commands at its time [s]; return where the vehicle stands after the last."""
        self._controller.reset()
        began_s = self._controller.now_s + phase_s
        pulses = self._controller.run_until(began_s)
        for at_s, what in said:
            pulses += self._controller.exchange(b"", began_s + at_s)[1]
            for one in what:
                if isinstance(one, Command):
                    self._controller.set_command(one)
                else:
                    self._controller.exchange(one, self._controller.now_s)
        pulses += self._controller.exchange(b"", began_s + said[-1][0] + SETTLE_S)[1]
        return self._driven(pulses)

    def _driven(self, pulses: list[Pulse]) -> Floats:
        """Return where the pulses, each from its falling edge on, take the vehicle."""
        self._plant.reset((0.0, 0.0, 0.0), seed=0)
        held, now, pose = [1500.0] * 3, 0, (0.0, 0.0, 0.0)
        for pulse in pulses:
            pose = self._plant.advance(*held, (pulse.fall - now) / CYCLES_PER_S)
            now, held[pulse.channel] = pulse.fall, pulse.width_us
        return np.array(pose)

    @staticmethod
    def _from_host(commands: Commands) -> list[tuple[float, list[bytes | Command]]]:
        said = []
        for index, until_s in enumerate([*commands.t_s[1:].tolist(), commands.t_s[-1] + KEEP_ALIVE_S]):
            at_s = float(commands.t_s[index])
            repeats = max(1, math.ceil((until_s - at_s) / KEEP_ALIVE_S - 1e-9))
            said += [(at_s + k * KEEP_ALIVE_S, [commands.at(index)]) for k in range(repeats)]
        return said

    @staticmethod
    def _on_board(commands: Commands) -> list[tuple[float, list[bytes | Command]]]:
        lines: list[bytes | Command] = []
        for index, (at_s, until_s) in enumerate(pairwise(commands.t_s.tolist())):
            drive, front, rear = (round(value) for value in commands.at(index))
            parts = math.ceil((until_s - at_s) / LONGEST_SEGMENT_S)
            edges = [round(1e3 * (at_s + (until_s - at_s) * k / parts)) for k in range(parts + 1)]
            for begin_ms, end_ms in pairwise(edges):
                text = f"M {len(lines) + 1} {drive} {front} {rear} {end_ms - begin_ms}"
                lines.append(encode_line(text, checksum=True))
        alive = np.arange(KEEP_ALIVE_S, float(commands.t_s[-1]), KEEP_ALIVE_S).tolist()
        status: bytes | Command = encode_line("Q", checksum=True)
        return [(0.0, lines), *((at_s, [status]) for at_s in alive)]
