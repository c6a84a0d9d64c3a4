"""``live``: a simulated vehicle that moves in real time, to rehearse with what hardware will be like."""

from __future__ import annotations

import math
import threading

import numpy as np

from agvbench.adapters.contract import SILENCE_LIMIT_S, AdapterOptions, AgvReports
from agvbench.adapters.simulated_agv import SimulatedAgv
from agvbench.bus.clock import wait_until
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.request import Replay, Reset
from agvbench.bus.messages.truth import TruthFlags
from agvbench.errors import AgvbenchError
from agvbench.types import Command, Plant


class LiveAgv(SimulatedAgv):
    """A plant behind the bus that runs in real time, without lock step.

    A thread advances the plant from one of the camera's instants to the next, as they come in `AdapterOptions.clock`;
    a command takes effect when it arrives. Runs are not reproducible, as with hardware.
    """

    scheme = "live"
    lock_step = False
    watchdog_s = SILENCE_LIMIT_S

    def __init__(self, plant: Plant, options: AdapterOptions) -> None:
        super().__init__(plant, options)
        self._clock = options.clock
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._move, name="agvbench-live", daemon=True)

    def start(self, reports: AgvReports) -> None:
        """Begin to move."""
        super().start(reports)
        self._thread.start()

    def reset(self, request: Reset) -> None:
        """Place the plant at rest."""
        with self._lock:
            super().reset(request)
            self._plant_s = self._clock.now()

    def apply(self, message: CommandMessage) -> None:
        """Hold another command from now on."""
        if not message.flags & (CommandFlags.FLUSH | CommandFlags.KEEP_ALIVE):
            self._hold(message.command)

    def replay(self, request: Replay) -> None:
        """Drive a recorded run again, as fast as the plant can."""
        self.reset(request.reset)
        with self._lock:
            durations = np.diff(np.append(request.commands.t_s, request.until_s))
            for index, duration_s in enumerate(durations.tolist()):
                self._plant.advance(*request.commands.at(index), max(0.0, duration_s))
            self._plant_s = self._clock.now()

    def stop(self) -> None:
        """Hold neutral from now on."""
        self._hold(self._neutral)

    def close(self) -> None:
        """Move no more."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _hold(self, command: Command) -> None:
        with self._lock:
            self._advance_to(self._clock.now())
            self._held = self._options.channels.limited(command)

    def _advance_to(self, now_s: float) -> tuple[float, float, float] | None:
        if self._sampling is None:
            return None
        duration_s, self._plant_s = max(0.0, now_s - self._plant_s), max(self._plant_s, now_s)
        return self._plant.advance(*self._held, duration_s)

    def _move(self) -> None:
        while not self._closed.is_set():
            sampling = self._sampling
            if sampling is None:
                self._clock.wait(self._closed, 0.005)
                continue
            number = math.floor((self._clock.now() - sampling.phase_s) * sampling.rate_hz) + 1
            instant_s = sampling.phase_s + number / sampling.rate_hz
            wait_until(self._clock, instant_s)
            try:
                self._show(instant_s)
            except AgvbenchError as error:
                self._sampling = None
                self._reports.failed(error)

    def _show(self, instant_s: float) -> None:
        with self._lock:
            pose = self._advance_to(instant_s)
        if pose is not None:
            flags = TruthFlags.LAST | TruthFlags.LIVE
            self._reports.truth(np.array([instant_s]), np.array([pose]), end_s=self._clock.now(), flags=flags)
