"""``simavr``: the vehicle's firmware in a simulated microcontroller, its servo pulses driving a plant, in lock step.

``simavr:1`` and ``simavr:2`` are the two versions of the firmware; ``simavr`` is the second. Commands go through the
serial protocol and a pseudo-terminal to the same program that is flashed into the vehicle. ``simavr:2,phase_ms=5``
begins every run at the same phase of the servo frame, to see what that phase makes.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from agvbench.adapters.agv.sim import SimAgv
from agvbench.adapters.contract import AdapterOptions, run_seed
from agvbench.adapters.serial_line.dialect import check_channels
from agvbench.adapters.simavr.address import FRAME_S, FirmwareAddress
from agvbench.adapters.simavr.host import CYCLES_PER_S, Pulse
from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import Reset
from agvbench.errors import LinkError
from agvbench.simulator import load_plant
from agvbench.types import Command, Floats, Plant

KEEP_ALIVE_S = 0.1
_SLACK_S = 1e-9
_DEFAULT = FirmwareAddress()


class SimavrAgv(SimAgv):
    """A plant whose servos are moved by the firmware's pulses.

    A run begins with a reset of the microcontroller and a wait of up to one servo frame that the run's key decides on:
    where in a frame commands fall is random, and the same when the run is repeated.

    Parameters
    ----------
    plant
        Each pulse is what it holds, from the pulse's falling edge to that of the channel's next.
    options
        Its ``channels`` take microseconds.
    address
        Which firmware, and at which phase of its frame runs begin.
    """

    scheme = "simavr"

    def __init__(self, plant: Plant, options: AdapterOptions, address: FirmwareAddress = _DEFAULT) -> None:
        check_channels(options.channels, where=self.scheme)
        super().__init__(plant, options)
        self._phase_s = address.phase_s
        self._controller = Microcontroller(address.version)
        self._sent: Command | None = None
        self._sent_s = self._base_s = math.nan
        self._pulses: list[Pulse] = []

    @property
    def line(self) -> Microcontroller:
        """The line, for faults to rehearse with."""
        return self._controller

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> SimavrAgv:
        """Start the firmware of `address` with the plant that the options name."""
        firmware = FirmwareAddress.parse(address, where=cls.scheme)
        return cls(load_plant(options.plant, options.plant_options)(options.seed), options, firmware)

    def identity(self) -> AgvIdentity:
        """Return the vehicle's identity, with its firmware's."""
        sim, hello = super().identity(), self._controller.hello
        extra = {**sim.extra, "firmware_calibration": hello.calibration_hash, "firmware_unit": hello.unit}
        firmware = f"agvbench {hello.firmware_version} in simavr"
        return AgvIdentity(
            sim.vehicle, sim.adapter, firmware, sim.calibration_hash, sim.channels, sim.simulated,
            sim.lock_step, extra,
        )  # fmt: skip

    def reset(self, request: Reset) -> None:
        """Place the plant at rest, and reset the microcontroller."""
        super().reset(request)
        self._controller.reset()
        self._controller.run_until(self._controller.now_s + self._wait_s(request.run_key))
        self._sent, self._base_s, self._pulses = None, math.nan, []

    def _wait_s(self, run_key: str) -> float:
        """Return how long after its reset the vehicle is left alone: this decides on the phase of its frames."""
        if self._phase_s is not None:
            return self._phase_s
        return FRAME_S * run_seed(self._options.seed, run_key, "servo frame") / 2.0**32

    def stop(self) -> None:
        """Send neutral: the vehicle obeys as soon as time passes, if it still receives anything."""
        with suppress(LinkError, OSError):
            self._controller.set_command(self._neutral)
        self._sent = None

    def close(self) -> None:
        """End the simulated microcontroller."""
        self._controller.close()

    def _hold(self, command: Command, from_s: float) -> None:
        """Say the command at `from_s`, unless it has been said."""
        if math.isnan(self._base_s):
            self._base_s = self._controller.now_s - from_s
        if command != self._sent:
            self._send_command(command, from_s)

    def _send_command(self, command: Command, at_s: float) -> None:
        self._controller.set_command(command)
        self._sent, self._sent_s = command, at_s

    def _advance_through(self, instants: Floats) -> tuple[Floats, Floats]:
        """Let firmware and plant go on until the command's interval ends."""
        self._run_firmware(self._end_s)
        poses = []
        for instant in instants.tolist():
            self._take_pulses_until(instant)
            poses.append(self._advance_plant(instant))
        return instants, np.array(poses, dtype=np.float64).reshape(-1, 3)

    def _run_firmware(self, end_s: float) -> None:
        """Run until `end_s`, saying the command again every `KEEP_ALIVE_S` as a runner does in real time."""
        while (next_s := self._sent_s + KEEP_ALIVE_S) < end_s - _SLACK_S:
            self._pulses += self._controller.run_until(self._base_s + next_s)
            assert self._sent is not None  # noqa: S101  (an interval begins with a command)
            self._send_command(self._sent, next_s)
        self._pulses += self._controller.run_until(self._base_s + end_s)

    def _take_pulses_until(self, until_s: float) -> None:
        while self._pulses:
            fall_s = self._pulses[0].fall / CYCLES_PER_S - self._base_s
            if fall_s > until_s:
                return
            pulse = self._pulses.pop(0)
            self._advance_plant(fall_s)
            held = list(self._held)
            held[pulse.channel] = pulse.width_us
            self._held = Command(*held)

    def _advance_plant(self, until_s: float) -> tuple[float, float, float]:
        duration_s, self._plant_s = max(0.0, until_s - self._plant_s), max(self._plant_s, until_s)
        return self._plant.advance(*self._held, duration_s)
