"""How far runs may end from their prediction by scatter alone, each by its own commands.

A long slalom ends ten times as far off as a short straight by the same scatter of the axles: what groups of repeats
miss can only be compared in units of what each of them may miss.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.fitting import Fit
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.scatter import priors
from agvbench.types import Floats


@dataclass(frozen=True)
class EndSpread:
    """How far each run's last sample may be off, in its start frame [m, m, rad].

    ``own`` (R, 3, 3): covariance of run and frame, drawn anew with each repeat; ``slopes`` (R, 3, P) by the fitted
    parameters, and ``parameters`` (P, P), what these may be off by: that is shared, by repeats of a command and by all
    commands that meet in a parameter.
    """

    own: Floats
    slopes: Floats
    parameters: Floats

    def select(self, chosen: NDArray[np.bool_]) -> EndSpread:
        """Return those of the runs that a mask chooses."""
        return EndSpread(self.own[chosen], self.slopes[chosen], self.parameters)


def end_spread(every: Predictor, fitted: Fit) -> EndSpread:
    """Return how far the runs of `every` may end from what it predicts with the parameters of `fitted`."""
    readings = every.readings
    linear = every.linearise(fitted.parameters, np.zeros((len(readings), 6)))
    rows = np.arange(len(readings))
    last = readings.seen.shape[1] - 1 - np.argmax(readings.seen[:, ::-1], axis=1)
    turn = np.zeros((len(readings), 3, 3))
    cos, sin = np.cos(readings.start[:, 2]), np.sin(readings.start[:, 2])
    turn[:, 0, 0] = turn[:, 1, 1] = cos
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = sin, -sin, 1.0
    a = turn @ linear.by_offsets[rows, last]
    j = turn @ linear.by_parameters[rows, last]
    scatter = fitted.scatter
    frame = np.diag(np.square([scatter.position_m, scatter.position_m, scatter.heading_rad]))
    own = (a * priors(every, scatter)[:, None, :] ** 2) @ a.transpose(0, 2, 1) + frame
    return EndSpread(own, j, fitted.covariance)
