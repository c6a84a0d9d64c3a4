"""Which empirical terms look promising, and from where to fit them: linear regressions on residual rates.

Each option's sizes follow by least squares and are judged by groups of runs that they were not fitted to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.empirical_options import options
from agvbench.diagnosis.empirical_regression import FOLDS, Judge, Steering
from agvbench.diagnosis.grouping import folds
from agvbench.diagnosis.residual_rates import Rates
from agvbench.diagnosis.terms import EmpiricalTerm
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_SMALL = 0.1


@dataclass(frozen=True)
class Start:
    """A term to try: values (2, p) to start a fit from, and its ``gain``, a log likelihood ratio on runs left out.

    The second row is the same shape at a tenth of its size: where each run's offsets have taken a cause up, they must
    give it back bit by bit.
    """

    term: type[EmpiricalTerm]
    values: Floats
    gain: float


def screen(rates: Rates, stands: Steering, geometry: Geometry, group: NDArray[np.int64], seed: int) -> list[Start]:
    """Return for each term its best start, the most promising term first; terms without promise are left out."""
    judge = Judge(rates, stands, folds(group, FOLDS, seed)[rates.run])
    found = []
    for term, shapes in options(rates, stands, geometry, judge):
        best: Start | None = None
        for columns, values in shapes:
            gain, sizes = judge.gain(columns)
            if gain > (best.gain if best else 0.0):
                best = Start(term, np.array([values(sizes), values(_SMALL * sizes)], dtype=np.float64), gain)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda start: -start.gain)
