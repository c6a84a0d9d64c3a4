"""A real vehicle that obeys no command, for tests of real cameras."""

from __future__ import annotations

from agvbench.adapters import AdapterOptions, AgvAdapter, AgvIdentity, CommandMessage


class StillVehicle(AgvAdapter):
    """Takes commands, and moves nothing."""

    def __init__(self, options: AdapterOptions) -> None:
        self._options = options

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> StillVehicle:
        return cls(options)

    def identity(self) -> AgvIdentity:
        name, channels = self._options.vehicle, self._options.channels
        return AgvIdentity(name, "still", "none", "", channels, simulated=False, lock_step=False)

    def apply(self, message: CommandMessage) -> None:
        pass

    def stop(self) -> None:
        pass

    def close(self) -> None:
        pass
