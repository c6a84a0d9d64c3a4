"""How old the vehicle's calibration is."""

from __future__ import annotations

import time

from agvbench.model import VehicleModel
from agvbench.workflows.doctor.finding import Check, Finding, Lab, State

_OLD_DAYS = 30.0
_DAY_S = 86_400.0


class Calibration(Check):
    """Looks for the newest calibrated vehicle of the campaigns, and reads it."""

    name = "calibration"

    def examine(self, lab: Lab) -> Finding:
        """Compare its age with a month."""
        files = [*lab.folder.glob("vehicle.toml"), *lab.folder.glob("campaigns/*/vehicle.toml")]
        if not files:
            return Finding(State.DOUBTFUL, "no calibrated vehicle here", "calibrate it: agvbench bench")
        newest = max(files, key=lambda path: path.stat().st_mtime)
        name = VehicleModel.load(newest).name
        days = (time.time() - newest.stat().st_mtime) / _DAY_S
        if days > _OLD_DAYS:
            return Finding(
                State.DOUBTFUL, f"{newest} ({name}) is {days:.0f} days old (limit: {_OLD_DAYS:g})",
                "calibrate again: agvbench bench calibration",
            )  # fmt: skip
        return Finding(State.GOOD, f"{newest} ({name}), {days:.1f} days old")
