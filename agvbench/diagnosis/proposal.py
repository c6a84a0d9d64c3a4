"""What is proposed to be driven next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agvbench.planning import Trajectory
from agvbench.types import Pose


@dataclass(frozen=True)
class Discrimination:
    """What the proposed run does for one pair of alternatives.

    ``between`` their names; ``evidence`` expected in minus two log likelihood for all repeats; ``apart_mm`` and
    ``apart_deg``: the farthest that their predictions differ along it, before either is fitted again.
    """

    between: tuple[str, str]
    evidence: float
    apart_mm: float
    apart_deg: float


@dataclass(frozen=True)
class NextExperiment:
    """The run to drive: ``why`` in words, ``trajectory``, how many ``repeats`` and from which ``starts`` in turn.

    ``separates`` says for each pair of alternatives how well; ``pins`` which parameters it would identify.
    """

    why: str
    trajectory: Trajectory
    repeats: int
    starts: tuple[Pose, ...] = ()
    separates: tuple[Discrimination, ...] = ()
    pins: tuple[str, ...] = ()

    def to_table(self) -> dict[str, Any]:
        """Return what stands in the diagnosis' JSON."""
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
    """What may be driven next, if anything can decide, and what no run can.

    ``inseparable`` pairs of alternatives, with the measurement that would distinguish them.
    """

    experiment: NextExperiment | None = None
    inseparable: Mapping[tuple[str, str], str] = field(default_factory=dict)
