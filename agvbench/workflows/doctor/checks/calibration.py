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
        files = list(lab.folder.glob("campaigns/*/vehicle.toml"))
        names = {path: VehicleModel.load(path).name for path in files}
        # A lab folder begins with a vehicle that nobody has measured: only a campaign makes it a calibrated one.
        for own in lab.folder.glob("vehicle.toml"):
            if "campaign" in (model := VehicleModel.load(own)).provenance:
                names[own] = model.name
        if not names:
            return Finding(State.DOUBTFUL, "no calibrated vehicle here", "calibrate it: agvbench bench")
        newest = max(names, key=lambda path: path.stat().st_mtime)
        name = names[newest]
        days = (time.time() - newest.stat().st_mtime) / _DAY_S
        if days > _OLD_DAYS:
            return Finding(
                State.DOUBTFUL, f"{newest} ({name}) is {days:.0f} days old (limit: {_OLD_DAYS:g})",
                "calibrate again: agvbench bench calibration",
            )  # fmt: skip
        return Finding(State.GOOD, f"{newest} ({name}), {days:.1f} days old")
