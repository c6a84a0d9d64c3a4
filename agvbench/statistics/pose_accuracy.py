"""Pose accuracy and pose repeatability in the words of ISO 9283, and how often a trajectory was completed.

ISO 9283:1998 defines them for manipulators; ISO 18646-2:2019 (navigation of mobile service robots) measures pose
accuracy and repeatability, too. Here the position is planar, the commanded pose is the target in the start frame, and
the number of repeats is that of the campaign.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from agvbench.campaign.attempts import Attempt, attempt_of
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.intervals import failure_bound
from agvbench.statistics.rest_poses import STILL_MOVING_AT_END
from agvbench.statistics.run_errors import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

ACCURACY_COLUMNS = ("trajectory", "condition", "repeats", "ap_mm", "ap_deg", "mean_radius_mm", "rp_mm", "rp_deg")
COMPLETION_COLUMNS = ("trajectory", "condition", "attempts", "not_completed", "left_out", "failure_bound")
_FEWEST = 3
"""Repeats: two lie at equal distances from their mean, so that S is zero."""


def pose_accuracy(positions: Floats) -> tuple[float, float, float]:
    """Return AP, the mean radius and RP of position errors (n, 2), in their unit.

    AP is the distance of the barycentre of the attained positions from the commanded one. With l the distances of the
    attained positions from their barycentre, RP = mean(l) + 3·S, S the standard deviation of l with n − 1. Fewer than
    three positions have no RP (NaN).

    >>> ap, radius, rp = pose_accuracy(np.array([[3.0, 5.0], [3.0, 3.0], [2.0, 4.0], [4.0, 4.0]]))
    >>> ap, radius, rp
    (5.0, 1.0, 1.0)
    """
    centre = positions.mean(axis=0)
    radii = np.hypot(*(positions - centre).T)
    ap = float(math.hypot(*centre))
    mean = float(radii.mean())
    if len(radii) < _FEWEST:
        return ap, mean if len(radii) > 1 else math.nan, math.nan
    return ap, mean, mean + 3.0 * float(radii.std(ddof=1))


def pose_accuracies(errors: pd.DataFrame) -> pd.DataFrame:
    """Return AP and RP per trajectory and condition, of position [mm] and heading [deg].

    AP of the heading is the mean heading error, signed; its RP is 3 standard deviations. Fewer than three
    repeats have no RP (NaN).
    """
    import pandas as pd

    rows = []
    for (trajectory, condition), group in _groups(valid(errors)):
        ap, radius, rp = pose_accuracy(group[["along_mm", "across_mm"]].to_numpy(dtype=float))
        headings = group["delta_heading_deg"].to_numpy(dtype=float)
        spread = 3.0 * float(headings.std(ddof=1)) if len(headings) >= _FEWEST else math.nan
        rows.append((trajectory, condition, len(group), ap, float(headings.mean()), radius, rp, spread))
    return pd.DataFrame(rows, columns=list(ACCURACY_COLUMNS))


def completions(errors: pd.DataFrame) -> pd.DataFrame:
    """Return how many attempts at each trajectory and condition were not completed, with the exact 95 % bound of it.

    Causes count (`agvbench.campaign.attempts`): a vehicle that leaves the workspace or still moves when the run ends
    did not complete it. Runs that camera, operator or installation ended, that were rejected for their recording, or
    whose end pose cannot be measured, say nothing about the vehicle: they are left out, and counted.
    """
    import pandas as pd

    rows = []
    for (trajectory, condition), group in _groups(errors):
        became = [_became(str(s), str(p)) for s, p in zip(group["status"], group["problem"], strict=True)]
        failed = became.count(Attempt.NOT_COMPLETED)
        attempts = failed + became.count(Attempt.COMPLETED)
        bound = failure_bound(failed, attempts)
        rows.append((trajectory, condition, attempts, failed, len(group) - attempts, bound))
    return pd.DataFrame(rows, columns=list(COMPLETION_COLUMNS))


def _became(status: str, problem: str) -> Attempt:
    became = attempt_of(status)
    if became is not Attempt.COMPLETED or not problem:
        return became
    return Attempt.NOT_COMPLETED if problem == STILL_MOVING_AT_END else Attempt.NONE


def _groups(errors: pd.DataFrame) -> list[tuple[tuple[str, str], pd.DataFrame]]:
    return [
        ((str(trajectory), condition), rows[rows["condition"] == condition])
        for trajectory, rows in errors.groupby("trajectory", sort=False)
        for condition in in_order(rows["condition"])
    ]


def prediction_ellipse(points: Floats) -> tuple[Floats, Floats] | None:
    """Return the ellipse in which a further point lies with 95 % probability, if points (n, 2) are normal.

    Its centre (2,), and its half axes as columns (2, 2), in the unit of the points; None below four points, and where
    they lie on a line. The squared Mahalanobis distance of a new point from the mean is (n + 1)(n − 1)·2/(n (n − 2))
    times an F with 2 and n − 2 degrees of freedom (Hotelling's T²).
    """
    from scipy.special import fdtri  # not scipy.stats, which takes half a second to import

    n = len(points)
    if n < 4:
        return None
    centre = points.mean(axis=0)
    variances, directions = np.linalg.eigh(np.cov(points.T))
    if variances[0] <= 1e-9 * variances[1]:
        return None
    limit = 2.0 * (n + 1.0) * (n - 1.0) / (n * (n - 2.0)) * float(fdtri(2, n - 2, 0.95))
    return centre, np.asarray(directions * np.sqrt(limit * variances))
