"""The proposal of the next experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agvbench.planning import Trajectory
from agvbench.types import Pose


@dataclass(frozen=True)
class Discrimination:
    """How well the proposed run discriminates one pair of alternatives.

    ``between``: their names. ``evidence``: expected minus two log likelihood ratio of all repeats. ``apart_mm`` and
    ``apart_deg``: the largest difference of their predictions along the run, before refitting.
    """

    between: tuple[str, str]
    evidence: float
    apart_mm: float
    apart_deg: float


@dataclass(frozen=True)
class NextExperiment:
    """The run to drive next: ``why``, ``trajectory``, number of ``repeats`` and their ``starts`` in turn.

    ``separates`` rates the discrimination of each pair of alternatives. ``pins`` names the parameters that the run
    identifies.
    """

    why: str
    trajectory: Trajectory
    repeats: int
    starts: tuple[Pose, ...] = ()
    separates: tuple[Discrimination, ...] = ()
    pins: tuple[str, ...] = ()

    def to_table(self) -> dict[str, Any]:
        """Return the content for the diagnosis' JSON."""
        return {
            "why": self.why,
            "trajectory": self.trajectory.to_table(),
            "repeats": self.repeats,
            "starts": [
                {
                    "x_m": round(p.x_m, 4),
                    "y_m": round(p.y_m, 4),
                    "heading_deg": round(float(np.degrees(p.heading_rad)), 2),
                }
                for p in self.starts
            ],
            "separates": [
                {
                    "between": list(s.between),
                    "evidence": round(s.evidence, 1),
                    "apart_mm": round(s.apart_mm, 2),
                    "apart_deg": round(s.apart_deg, 3),
                }
                for s in self.separates
            ],
            "pins": list(self.pins),
        }


@dataclass(frozen=True)
class Proposal:
    """The next experiment, if a run can discriminate any pair of alternatives.

    ``inseparable`` maps the other pairs to the measurement that would discriminate them.
    """

    experiment: NextExperiment | None = None
    inseparable: Mapping[tuple[str, str], str] = field(default_factory=dict)
