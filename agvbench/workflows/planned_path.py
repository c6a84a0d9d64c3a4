"""Where runs were planned to go, for recordings: the geometry of their trajectories, where these are still known."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from agvbench.campaign import CampaignHeader
from agvbench.errors import AgvbenchError, FitError
from agvbench.model import VehicleModel, thesis_vehicle
from agvbench.planning import Plan, load_trajectory, plan, steered
from agvbench.planning.trajectories.trajectory import TRAJECTORY_NAME
from agvbench.statistics.rest_poses import start_pose
from agvbench.types import Floats, Pose, Run
from agvbench.vehicle.geometry import Geometry

_SAME_TARGET = 1e-6


class PlannedPaths:
    """Plans the runs of a campaign again, with its vehicle: a path is geometry, the same under each condition.

    Parameters
    ----------
    path, header
        The campaign; without a ``vehicle.toml`` in it, the thesis' vehicle with the campaign's axles.
    """

    def __init__(self, path: Path, header: CampaignHeader) -> None:
        self._model = _vehicle(path, header)
        self._plan = lru_cache(maxsize=None)(self._planned)

    def of(self, run: Run) -> tuple[Floats | None, Pose | None]:
        """Return the path in the floor frame, shape (n, 2) [m], and the target pose there.

        None for a path whose trajectory is not known here, or leads to another target than the run had; None for the
        target of a run that has none. The start is the measured one.
        """
        try:
            start = start_pose(run).pose
        except FitError:
            return None, None
        target = start.compose(run.target) if run.target.is_finite else None
        made = self._plan(run.trajectory)
        if made is None or not np.allclose(made.target, run.target, rtol=0.0, atol=_SAME_TARGET, equal_nan=True):
            return None, target
        c, s = np.cos(start.heading_rad), np.sin(start.heading_rad)
        return made.expected[:, 1:3] @ np.array([[c, s], [-s, c]]) + np.array(start[:2]), target

    def _planned(self, name: str) -> Plan | None:
        if not TRAJECTORY_NAME.fullmatch(name) or name.endswith(".toml"):
            return None
        try:
            return plan(steered(load_trajectory(name), "", self._model), self._model)
        except AgvbenchError:
            return None


def _vehicle(path: Path, header: CampaignHeader) -> VehicleModel:
    try:
        return VehicleModel.load(path / "vehicle.toml")
    except AgvbenchError:
        return replace(thesis_vehicle(), geometry=Geometry(header.front_axle_m, header.rear_axle_m))
