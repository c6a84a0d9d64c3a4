"""What a diagnosis was asked of."""

from __future__ import annotations

from dataclasses import dataclass

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.provenance import provenance
from agvbench.diagnosis.reading import Readings
from agvbench.diagnosis.result import Diagnosis, Verdict
from agvbench.model import VehicleModel
from agvbench.vehicle.geometry import Geometry


@dataclass(frozen=True)
class Asked:
    """What a diagnosis was asked of: the campaign's header, the model before if one was given, the seed."""

    header: HeaderLike
    geometry: Geometry
    vehicle: VehicleModel | None
    seed: int

    def cannot_tell(self, readings: Readings, why: str) -> Diagnosis:
        """Return the answer that the campaign cannot tell, and why."""
        return Diagnosis(Verdict.NOT_IDENTIFIABLE, why, provenance=self.provenance(readings))

    def provenance(self, readings: Readings) -> dict[str, object]:
        """Return where the answer comes from."""
        if readings.begins is None:
            return provenance(self.header, readings, self.seed, runs_used=len(readings))
        driven = {run.run_id.rpartition("@")[0] for run in readings.runs}
        return provenance(self.header, readings, self.seed, runs_used=len(driven)) | {"windows_used": len(readings)}
