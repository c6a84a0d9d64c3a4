"""The planned paths of a campaign's runs, planned again from the trajectories that it drove."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import get_args

import numpy as np

from agvbench.campaign import Campaign
from agvbench.campaign.manifest import sha256
from agvbench.campaign.names import planned_name
from agvbench.errors import AgvbenchError
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.model import VehicleModel, nominal_model, thesis_vehicle
from agvbench.planning import Plan, load_trajectory, plan, steered
from agvbench.planning.trajectories.loading import trajectory_file
from agvbench.planning.trajectories.segments import Steering
from agvbench.planning.trajectories.trajectory import TRAJECTORY_NAME
from agvbench.statistics.matching import same_target
from agvbench.text_files import read_toml
from agvbench.types import Floats, Run

_SAME_TARGET = 1e-3
"""In m and rad: plans of two calibrations differ by micrometres where an axle stands a little off."""
_INPUTS, _INPUT = "inputs", "trajectory "
_SETTINGS = "bench.toml"


class PlannedPaths:
    """Plans the runs of a campaign again, with its vehicle: a path is geometry, the same under each condition.

    An uncalibrated vehicle drives it at other times: those of its commands.

    Without a ``vehicle.toml`` in the campaign, the thesis' vehicle with the campaign's axles is used, or a nominal
    differential one. A trajectory whose file is not the recorded one has no path.
    """

    def __init__(self, campaign: Campaign) -> None:
        self._model = _vehicle(campaign)
        self._recorded = _recorded_hashes(campaign)
        self._steering = _steering(campaign)
        self._plan = lru_cache(maxsize=None)(self._planned)

    def of(self, run: Run) -> Floats | None:
        """Return the path in the start frame, shape (n, 4): t [s], x, y [m], heading [rad, unwrapped].

        None if the trajectory is not known here, has changed, or leads to another target than the run had.
        """
        made = self.plan(planned_name(run))
        if made is None or not same_target(made.target, run.target, _SAME_TARGET):
            return None
        return _as_commanded(made, run) if run.condition == "uncalibrated" else made.expected

    def measured(self, run: Run) -> MeasuredRun:
        """Return `run` with its planned path, where it has one."""
        return MeasuredRun.of(run, self.of(run))

    def plan(self, name: str) -> Plan | None:
        """Return the plan of the trajectory `name`; None if it is not known here, or has changed."""
        return self._plan(name)

    def _planned(self, name: str) -> Plan | None:
        if not TRAJECTORY_NAME.fullmatch(name) or name.endswith(".toml"):
            return None
        try:
            if self._recorded.get(name) not in (None, sha256(trajectory_file(name))):
                return None
            return plan(steered(load_trajectory(name), self._steering, self._model), self._model)
        except (AgvbenchError, OSError):
            return None


def _as_commanded(made: Plan, run: Run) -> Floats:
    """Return the path with the times of the run's own commands: nominal maps plan the same path at other times."""
    if len(run.commands) != len(made.commands):
        return made.expected
    t_s = np.interp(made.expected[:, 0], made.commands.t_s, run.commands.t_s)
    return np.column_stack([t_s, made.expected[:, 1:]])


def _steering(campaign: Campaign) -> str:
    """Return the mode in which a bench steered every trajectory, as its settings say; "" where each says its own."""
    try:
        stated = read_toml(campaign.path / _SETTINGS).get("steering", "")
    except (AgvbenchError, OSError, ValueError):
        return ""  # another program's campaign has no settings of a bench
    return stated if stated in get_args(Steering) else ""


def _vehicle(campaign: Campaign) -> VehicleModel:
    try:
        return VehicleModel.load(campaign.path / "vehicle.toml")
    except AgvbenchError:
        geometry = campaign.header.geometry
        if geometry.is_differential:
            return nominal_model(campaign.header.vehicle_name, geometry, campaign.header.channels)
        return replace(thesis_vehicle(), geometry=geometry)


def _recorded_hashes(campaign: Campaign) -> Mapping[str, str]:
    """Return the hashes of the trajectories' files by name; none where the campaign did not record them."""
    try:
        table = campaign.table(_INPUTS)
        rows = zip(table["input"].astype(str), table["sha256"].astype(str), strict=True)
        return {name.removeprefix(_INPUT): digest for name, digest in rows if name.startswith(_INPUT)}
    except (AgvbenchError, KeyError):
        return {}
