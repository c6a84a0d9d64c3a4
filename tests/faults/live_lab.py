"""A lab in real time: the firmware in simavr behind its serial port moves a plant, which a NatNet server sees."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np

from agvbench.adapters.contract import DEFAULT_PLANT
from agvbench.adapters.natnet.axes import bodies_of
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import MARKER
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.adapters.simavr.host import Pulse, SimavrHost
from agvbench.bus.clock import WallClock, wait_until
from agvbench.errors import AgvbenchError
from agvbench.simulator import Camera, load_plant
from agvbench.types import Command

RATE_HZ = 120.0
NAME, BODY, OTHER = "agv1", 1, 7
_NO_MARKERS = np.zeros(0, MARKER)
_NEUTRAL_US, _STILL_US = 1500.0, 5.0


class LiveLab:
    """Vehicle and camera; faults are injected by its attributes.

    Attributes
    ----------
    body
        The id that frames show.
    streams
        Whether the server sends frames.
    server
        The NatNet server.
    host
        The microcontroller's process.
    befall
        What befalls whoever has opened the lab's adapters.
    """

    def __init__(self, *, described: bool = True) -> None:
        self.body, self.streams = BODY, True
        self.befall: Callable[[], None] = lambda: None
        self.host = SimavrHost("2", live=True)
        self.server = Emulator(Settings(rate_hz=RATE_HZ), [Model(BODY, NAME)] if described else [])
        self._plant, self._camera = load_plant(DEFAULT_PLANT)(0), Camera.perfect(RATE_HZ)
        self._plant.reset((0.0, 0.0, 0.0), seed=0)
        self._noise = np.random.default_rng(0)
        self._held, self._plant_s = [_NEUTRAL_US] * 3, WallClock.now()
        self._lock, self._closed = threading.Lock(), threading.Event()
        self.last_driven_s = float("-inf")
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._take_pulses, self._film)]
        for thread in self._threads:
            thread.start()

    def describe(self) -> None:
        """Tell clients which bodies there are."""
        self.server.describe([Model(BODY, NAME)])

    def _take_pulses(self) -> None:
        with suppress(AgvbenchError, ValueError, OSError):
            while not self._closed.is_set():
                word, *numbers = self.host._line()
                if word == "pulse":
                    self._take(Pulse(*map(int, numbers)))

    def _take(self, pulse: Pulse) -> None:
        with self._lock:
            self._advance()
            self._held[pulse.channel] = pulse.width_us
            if pulse.channel == 0 and abs(pulse.width_us - _NEUTRAL_US) > _STILL_US:
                self.last_driven_s = WallClock.now()

    def _advance(self) -> tuple[float, float, float]:
        now_s = WallClock.now()
        duration_s, self._plant_s = max(0.0, now_s - self._plant_s), now_s
        return self._plant.advance(*Command(*self._held), duration_s)

    def _film(self) -> None:
        clock, began_s, number = WallClock(), WallClock.now(), 0
        while not self._closed.is_set():
            number += 1
            wait_until(clock, began_s + number / RATE_HZ)
            with self._lock:
                pose = np.array([self._advance()])
            if self.streams:
                self._send(number, pose)

    def _send(self, number: int, pose: np.ndarray) -> None:
        # A camera is never quite still; this one flickers by a tenth of a millimetre.
        pose[:, :2] += 1e-4 * self._noise.standard_normal(2)
        exposed_s = WallClock.now()
        frames = self._camera.observe(np.array([exposed_s]), pose, self._noise)
        ticks = self.server.ticks(exposed_s)
        body = bodies_of(frames, self.body)
        self.server.send(FrameOfData(number, body, _NO_MARKERS, exposed_s, ticks, ticks, ticks, 0))

    def close(self) -> None:
        """Switch everything off."""
        self._closed.set()
        self.server.close()
        self.host.close()
        for thread in self._threads:
            thread.join(2.0)


@contextmanager
def live_lab(*, described: bool = True) -> Iterator[LiveLab]:
    """Open a lab while the context lasts."""
    lab = LiveLab(described=described)
    try:
        yield lab
    finally:
        lab.close()
