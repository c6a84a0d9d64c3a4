"""How old the vehicle's calibration is."""

from __future__ import annotations

import time
from pathlib import Path

from agvbench.model import VehicleModel
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_OLD_DAYS = 30.0
_DAY_S = 86_400.0


class CalibrationCheck(Check):
    """Looks for the newest calibrated vehicle of the campaigns, and reads it."""

    name = "calibration"

    def examine(self, lab: Lab) -> Finding:
        """Compare its age with a month."""
        own, campaigns = lab.folder.glob("vehicle.toml"), lab.folder.glob("campaigns/*/vehicle.toml")
        newest = next(filter(_is_calibrated, sorted([*own, *campaigns], key=_age_s)), None)
        if newest is None:
            return Finding(FindingState.DOUBTFUL, "no calibrated vehicle here", "calibrate it: agvbench bench")
        name = VehicleModel.load(newest).name
        days = _age_s(newest) / _DAY_S
        if days > _OLD_DAYS:
            return Finding(
                FindingState.DOUBTFUL, f"{newest} ({name}) is {days:.0f} days old (limit: {_OLD_DAYS:g})",
                "calibrate again: agvbench bench calibration",
            )  # fmt: skip
        return Finding(FindingState.GOOD, f"{newest} ({name}), {days:.1f} days old")


def _is_calibrated(file: Path) -> bool:
    """Whether a campaign has measured the vehicle: a lab folder begins with a nominal one."""
    return file.parent.parent.name == "campaigns" or "campaign" in VehicleModel.load(file).provenance


def _age_s(file: Path) -> float:
    return time.time() - file.stat().st_mtime
