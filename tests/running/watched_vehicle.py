"""A vehicle in real time that stops itself when it hears nothing for 0.25 s, as the firmware does."""

from dataclasses import replace

from agvbench.adapters.agv.live import LiveAgv
from agvbench.bus.messages.event import Level


class WatchedVehicle(LiveAgv):
    """Reports a low battery and that it stopped itself whenever it is placed."""

    scheme = "watched"
    watchdog_s = 0.25

    def identity(self):
        identity = super().identity()
        return replace(identity, extra={**identity.extra, "firmware_calibration": "0123abcd"})

    def reset(self, request):
        super().reset(request)
        self._reports.event(Level.INFO, "battery_low", "7.1 V")
        self._reports.event(Level.WARNING, "vehicle_stopped_itself", "while it was placed")
