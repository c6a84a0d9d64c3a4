"""A vehicle in real time with a watchdog of its own, as the firmware has one, but with more patience."""

from msgspec.structs import replace

from agvbench.adapters.agv.live import LiveAgv
from agvbench.bus.messages.event import Level


class WatchedVehicle(LiveAgv):
    """Reports a low battery and that it stopped itself whenever it is placed."""

    scheme = "watched"
    watchdog_s = 2.0  # a busy machine may well hold up a command for the firmware's 0.25 s

    def identity(self):
        identity = super().identity()
        return replace(identity, extra={**identity.extra, "firmware_calibration": "0123abcd"})

    def reset(self, request):
        super().reset(request)
        self._reports.event(Level.INFO, "battery_low", "7.1 V")
        self._reports.event(Level.WARNING, "vehicle_stopped_itself", "while it was placed")
