"""``simavr-live``: the firmware in a simulated microcontroller, in real time, behind the adapter for serial ports.

``simavr-live:1`` and ``simavr-live:2`` are the two versions; ``simavr-live`` is the second. It is to ``simavr`` what
``live`` is to ``sim``: everything as with hardware, but for the vehicle.
"""

from __future__ import annotations

import threading

from msgspec.structs import replace

from agvbench.adapters.agv.live import LiveAgv
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.adapters.contract import AdapterOptions, AgvReports
from agvbench.adapters.serial_line.dialect import check_channels
from agvbench.adapters.serial_line.port import SerialPort
from agvbench.adapters.simavr.address import FRAME_S, FirmwareAddress
from agvbench.adapters.simavr.host import SimavrHost
from agvbench.bus.messages.command import CommandMessage
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import Reset
from agvbench.errors import AgvbenchError, LinkError
from agvbench.simulator import load_plant
from agvbench.types import Command, Plant

_FRAMES_TO_OBEY = 3


class SimavrLiveAgv(LiveAgv):
    """A plant whose servos are moved by the firmware's pulses as they come; the firmware is talked to as a vehicle is.

    Only the firmware's watchdog stops the pulses when the host is gone.

    Parameters
    ----------
    plant
        Each pulse is what it holds, from when the pulse is heard of, a few milliseconds after its falling edge.
    options
        Its ``channels`` take microseconds.
    version
        Of the firmware.
    """

    scheme = "simavr-live"

    def __init__(self, plant: Plant, options: AdapterOptions, version: str) -> None:
        check_channels(options.channels, where=self.scheme)
        super().__init__(plant, options)
        self._microcontroller = SimavrHost(version, live=True)
        try:
            self._serial = SerialAgv(SerialPort(self._microcontroller.port), options)
        except BaseException:
            self._microcontroller.close()
            raise
        self.watchdog_s = self._serial.watchdog_s
        self._pulses = threading.Thread(target=self._take_pulses, name="agvbench-pulses", daemon=True)

    @property
    def line(self) -> SerialPort:
        """The line, for faults to rehearse with."""
        return self._serial.line

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> SimavrLiveAgv:
        """Start the firmware of version `address` with the plant that the options name."""
        firmware = FirmwareAddress.parse(address, where=cls.scheme)
        if firmware.phase_s is not None:
            raise LinkError(
                "real time has no phase to choose", where=cls.scheme, value=address, remedy=f"use simavr:{address}"
            )
        return cls(load_plant(options.plant, options.plant_options)(options.seed), options, firmware.version)

    def identity(self) -> AgvIdentity:
        """Return the plant's identity, with the firmware's."""
        plant, vehicle = super().identity(), self._serial.identity()
        return replace(plant, firmware=f"{vehicle.firmware} in simavr", extra={**plant.extra, **vehicle.extra})

    def start(self, reports: AgvReports) -> None:
        """Begin to listen, and to move."""
        super().start(reports)
        self._serial.start(reports)
        self._pulses.start()

    def reset(self, request: Reset) -> None:
        """Say neutral, and place the plant at rest once the pulses are so."""
        self._serial.stop()
        self._clock.sleep(_FRAMES_TO_OBEY * FRAME_S)
        super().reset(request)

    def apply(self, message: CommandMessage) -> None:
        """Say the command to the firmware; said again, it keeps the watchdog quiet."""
        self._serial.apply(message)

    def stop(self) -> None:
        """Say neutral to the firmware."""
        self._serial.stop()

    def close(self) -> None:
        """Give the port back, and end the simulated microcontroller."""
        self._serial.close()
        self._microcontroller.process.terminate()
        if self._pulses.is_alive():
            self._pulses.join()
        self._microcontroller.close()
        super().close()

    def _take_pulses(self) -> None:
        """Let each pulse move its servo; a microcontroller that has ended sends none, and nothing moves."""
        try:
            for pulse in self._microcontroller.pulses():
                held = list(self._held)
                held[pulse.channel] = pulse.width_us
                self._hold(Command(*held))
            self._hold(self._neutral)
        except AgvbenchError as error:  # of the plant
            self._reports.failed(error)
