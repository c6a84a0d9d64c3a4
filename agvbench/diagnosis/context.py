"""The context of a diagnosis: campaign, vehicle and seed, with the provenance of its result."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.criteria import (
    FREE_DRIVING,
    FREE_DRIVING_LEVEL,
    LOGGED,
    SELECTION,
    SESSION_CLOCK,
    VARYING,
    stated_criteria,
)
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.result import Diagnosis, Verdict
from agvbench.errors import CampaignError
from agvbench.model import VehicleModel
from agvbench.model.priors import Prior
from agvbench.vehicle.geometry import Geometry


def require_runs(readings: Readings, header: HeaderLike) -> None:
    """Raise `CampaignError` if no run can be used, with the reason of the first."""
    if not len(readings):
        first = next(iter(readings.refused.items()), ("", "there are none"))
        raise CampaignError("no run can be used", where=f"campaign {header.name}", value=f"{first[0]}: {first[1]}")


@dataclass(frozen=True)
class DiagnosisContext:
    """The campaign's header, geometry, the vehicle model before if there is one, and the seed."""

    header: HeaderLike
    geometry: Geometry
    vehicle: VehicleModel | None
    seed: int

    @property
    def priors(self) -> tuple[Prior, ...]:
        """The priors of the vehicle file."""
        return self.vehicle.priors if self.vehicle else ()

    def not_identifiable(self, readings: Readings, why: str) -> Diagnosis:
        """Return a diagnosis with the verdict NOT_IDENTIFIABLE and its reason."""
        return Diagnosis(Verdict.NOT_IDENTIFIABLE, why, provenance=self.provenance(readings))

    def provenance(self, readings: Readings) -> dict[str, object]:
        """Return version, campaign, seed, numbers of runs used and of runs excluded by reason, and the criteria."""
        from agvbench import __version__

        windows = readings.initial_states is not None
        criteria = stated_criteria(FREE_DRIVING if windows else SELECTION, with_priors=bool(self.priors))
        if windows:
            criteria |= {"drive_level": asdict(FREE_DRIVING_LEVEL), "session_clock": asdict(SESSION_CLOCK)}
            criteria |= {"varying": asdict(VARYING)}
        logged: dict[str, object] = {}
        if stated := readings.logged.stated():
            criteria["logged"], logged = asdict(LOGGED), {"logged_columns": stated}
        driven = {run.run_id.rpartition("@")[0] if windows else run.run_id for run in readings.runs}
        return {
            "agvbench": __version__,
            "campaign": self.header.name,
            "seed": self.seed,
            "runs_used": len(driven),
            "runs_refused": dict(Counter(readings.refused.values())),
            **({"windows_used": len(readings)} if windows else {}),
            **logged,
            "criteria": criteria,
        }
