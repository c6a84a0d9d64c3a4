"""What the corrected model missed in earlier sessions, trajectory by trajectory: the last thing there is to correct.

An effect that is not in the library, or has another form than the library's, leaves a bias on each trajectory that was
measured. What of it stands out of the scatter is taken off the aim of the corrected plan. That is
learning, not understanding: it holds for this trajectory, driven from this place, and says nothing about any other.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from agvbench.campaign import Campaign
from agvbench.campaign.campaign import session_starts
from agvbench.errors import FitError
from agvbench.model import VehicleModel
from agvbench.planning import Departure
from agvbench.planning.end_pose_prediction import rest_poses
from agvbench.statistics.rest_poses import end_pose, start_pose
from agvbench.types import Floats, Pose, Run

FEWEST = 3
"""Fewer runs than this do not tell a bias from scatter."""


def remainders(campaign: Campaign, model: VehicleModel, condition: str) -> dict[str, dict[str, float]]:
    """Return, by trajectory, what `model` missed in the mean: the measured end pose in the frame of the predicted one.

    Learned from the runs of one condition: those with commands nearest to what will be driven. Each component is shrunk
    by the share of its square that its standard error explains, so that scatter is not learned.
    """
    runs = [run for run in campaign.select(condition=condition) if run.target.is_finite]
    began, out = session_starts(campaign), {}
    for name in dict.fromkeys(run.trajectory for run in runs):
        driven = ((run, run.started_s - began[run.session]) for run in runs if run.trajectory == name)
        missed = np.array(list(_missed(driven, model))).reshape(-1, 3)
        if len(missed) >= FEWEST:
            x, y, heading = shrunk(missed).tolist()
            out[name] = {"x_m": round(x, 6), "y_m": round(y, 6), "heading_rad": round(heading, 6), "runs": len(missed)}
    return out


def shrunk(values: Floats) -> Floats:
    """Return the mean of `values` (n, k), shape (k,), each shrunk towards zero by what scatter makes of it.

    >>> shrunk(np.array([[3.0, 1.0], [3.0, -1.0], [3.0, 0.5]])).tolist()
    [3.0, 0.0]
    """
    mean, stderr = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
    share = np.divide(stderr, mean, out=np.full_like(mean, np.inf), where=mean != 0.0)
    return np.asarray(mean * np.maximum(0.0, 1.0 - share**2))


def _missed(runs: Iterable[tuple[Run, float]], model: VehicleModel) -> Iterable[Pose]:
    for run, since_s in runs:
        try:
            start, end = start_pose(run).pose, end_pose(run).pose
        except FitError:
            continue  # a run without a pose at rest is no evidence
        departure = Departure(start, since_s / 3600.0)
        predicted = rest_poses(model, [run.commands], departure)[0]
        yield end.relative_to(start).relative_to(Pose(*predicted.tolist()))
