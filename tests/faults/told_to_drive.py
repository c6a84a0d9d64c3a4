"""Until when was a vehicle told to drive? Seen where it counts: at the plant, or at the pins of the microcontroller."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any
from unittest.mock import patch

from agvbench.adapters import node
from agvbench.adapters.agv.impaired import ImpairedAgv
from agvbench.adapters.agv.sim import SimAgv
from agvbench.adapters.agv.simavr import SimavrAgv
from agvbench.adapters.contract import AdapterOptions, AgvAdapter
from agvbench.adapters.simavr.host import CYCLES_PER_S
from agvbench.errors import AgvbenchError

NEUTRAL_US = 1500.0
_STILL_US = 5.0
_AFTER_S = 1.0


class Witness:
    """Listens to the vehicle of a rig; `last_s` is in the clock of its last run."""

    def __init__(self) -> None:
        self._vehicle: SimAgv | None = None
        self._pulses: list[Any] = []
        self._driven_s = float("-inf")
        self._stopped = threading.Event()

    def watch(self, vehicle: AgvAdapter) -> None:
        """Listen to `vehicle` from now on."""
        inner = vehicle.vehicle if isinstance(vehicle, ImpairedAgv) else vehicle
        if not isinstance(inner, SimAgv):
            return
        self._vehicle = inner
        plain_stop, plain_reset = inner.stop, inner.reset
        inner.stop = lambda: (plain_stop(), self._stopped.set())[0]  # type: ignore[method-assign,func-returns-value]

        def reset(request: Any) -> None:
            self._driven_s = float("-inf")
            self._stopped.clear()
            plain_reset(request)
            self._pulses.clear()

        inner.reset = reset  # type: ignore[method-assign]
        if isinstance(inner, SimavrAgv):
            self._watch_pins(inner)
        else:
            self._watch_plant(inner)

    def _watch_pins(self, vehicle: SimavrAgv) -> None:
        plain = vehicle.line.exchange

        def control_cycle(data: bytes, end_s: float) -> Any:
            heard, pulses = plain(data, end_s)
            self._pulses += pulses
            return heard, pulses

        vehicle.line.exchange = control_cycle  # type: ignore[method-assign]

    def _watch_plant(self, vehicle: SimAgv) -> None:
        plain = vehicle._drive

        def drive(command: Any, start_s: float, end_s: float) -> Any:
            driven = plain(command, start_s, end_s)
            if abs(command.drive - NEUTRAL_US) > _STILL_US:
                self._driven_s = end_s
            return driven

        vehicle._drive = drive  # type: ignore[method-assign]

    def last_s(self) -> float:
        """Return until when the vehicle was told to drive in its last run [s], once a second more has passed for it."""
        if not isinstance(self._vehicle, SimavrAgv):
            return self._driven_s
        self._stopped.wait(2.0)
        line = self._vehicle.line
        with suppress(AgvbenchError):  # a microcontroller that has ended makes no pulses any more
            line.exchange(b"", line.now_s + _AFTER_S)
        driven = [pulse.fall for pulse in self._pulses if pulse.channel == 0 and _drives(pulse)]
        return max(driven) / CYCLES_PER_S - self._vehicle._base_s if driven else float("-inf")


def _drives(pulse: Any) -> bool:
    return bool(abs(pulse.width_us - NEUTRAL_US) > _STILL_US)


@contextmanager
def witness() -> Iterator[Witness]:
    """Watch the vehicle of the next rig that is opened."""
    seen, plain = Witness(), node.open_agv

    def open_agv(spec: str, options: AdapterOptions) -> AgvAdapter:
        vehicle = plain(spec, options)
        seen.watch(vehicle)
        return vehicle

    with patch.object(node, "open_agv", open_agv):
        yield seen
