"""``impaired:FAULTS:ADAPTER``: another vehicle, and what goes wrong with it: to rehearse faults, never by itself."""

from __future__ import annotations

from msgspec.structs import replace

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, AgvReports
from agvbench.adapters.impairment.faults import Faults, SerialLine, vehicle_fault
from agvbench.adapters.impairment.spec import SCHEME, Impairment, parse_address
from agvbench.adapters.registry import open_agv
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import Replay, Reset
from agvbench.errors import LinkError


class ImpairedAgv(AgvAdapter):
    """A vehicle with faults, which are injected before its commands.

    Runs of a simulated vehicle are counted; a real one's are all the first.
    """

    scheme = SCHEME

    def __init__(self, vehicle: AgvAdapter, impairments: list[Impairment], options: AdapterOptions) -> None:
        self.vehicle, self._faults = vehicle, Faults(impairments, vehicle_fault, seed=options.seed)
        line = getattr(vehicle, "line", None)
        self._line = line if isinstance(line, SerialLine) else None
        for when, fault in self._faults:
            if fault.needs_line and self._line is None:
                raise LinkError("vehicle has no serial line", where=f"{SCHEME}:{when.name}", value=vehicle.scheme)
        self._neutral = options.channels.neutral
        self.watchdog_s = vehicle.watchdog_s

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> ImpairedAgv:
        """Open the vehicle behind the faults."""
        impairments, spec = parse_address(address)
        vehicle = open_agv(spec, options)
        try:
            return cls(vehicle, impairments, options)
        except BaseException:
            vehicle.close()
            raise

    def identity(self) -> AgvIdentity:
        """Return the vehicle's identity, marked as impaired."""
        identity = self.vehicle.identity()
        return replace(identity, extra={**identity.extra, "impaired": self._faults.names})

    def start(self, reports: AgvReports) -> None:
        """Let the vehicle report."""
        self.vehicle.start(reports)

    def apply(self, message: CommandMessage) -> None:
        """Let the faults strike that hold by now, and then the vehicle have its command."""
        if not message.flags & CommandFlags.FLUSH:
            for when, fault in self._faults:
                if when.holds(self._faults.run, message.t_s):
                    fault.inject(self._line)
                    message = replace(message, command=fault.alter(message.command, self._neutral))
        self.vehicle.apply(message)

    def reset(self, request: Reset) -> None:
        """Place a simulated vehicle; the line works again."""
        self._begin(request)
        self.vehicle.reset(request)

    def replay(self, request: Replay) -> None:
        """Drive a recorded run again; faults strike the first time only."""
        self._begin(request.reset)
        self.vehicle.replay(request)

    def _begin(self, request: Reset) -> None:
        if self._line is not None:
            self._line.wire = bytes
        self._faults.begin(request.run_key)

    def stop(self) -> None:
        """Stop the vehicle, as far as the faults let it hear of that."""
        self.vehicle.stop()

    def close(self) -> None:
        """Close the vehicle."""
        for _, fault in self._faults:
            fault.release()
        self.vehicle.close()
