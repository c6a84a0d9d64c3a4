"""Open a bench session: settings, vehicle, rig and campaign; new, resumed, or on paper only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from agvbench.adapters import open_rig
from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.model import VehicleModel
from agvbench.planning import Plan, Workspace
from agvbench.running.bench import Bench
from agvbench.running.calibrating import calibrate_campaign
from agvbench.running.constant import Shares
from agvbench.running.directory import choose_directory
from agvbench.running.driver import Driver, NotDrivenError
from agvbench.running.records import DriveOrder
from agvbench.running.settings import SETTINGS_FILE, BenchSettings, settings_for_resume
from agvbench.types import Run


class BenchSession:
    """What benchmarks see of a session: models, workspace, and drivers for their runs.

    ``bench`` is None in a dry run: everything is planned, nothing is driven.
    """

    def __init__(self, settings: BenchSettings, directory: Path, nominal: VehicleModel, bench: Bench | None) -> None:
        self.settings, self.directory, self.nominal = settings, directory, nominal
        self.workspace = Workspace.parse(settings.workspace)
        self.shares = Shares.of(nominal.command_unit, nominal.neutral, _signs(nominal))
        self.planned: list[tuple[DriveOrder, Plan]] = []
        self._bench = bench

    def model(self, condition: str) -> VehicleModel:
        """Return the vehicle model of `condition`; in a dry run one that stands in for what is not measured yet."""
        if self._bench is not None:
            return self._bench.model(condition)
        return self.nominal if condition == "uncalibrated" else stand_in(self.settings, self.nominal)

    def driver(self, run_id: str, *, experiment: str, repeat: int) -> Driver:
        """Return what drives the run `run_id`."""
        return Driver(self, run_id, experiment=experiment, repeat=repeat)

    def run(self, order: DriveOrder, planned: Plan) -> Run:
        """Drive `order`, or only note it in a dry run."""
        if self._bench is None:
            self.planned.append((order, planned))
            raise NotDrivenError("dry run")
        return self._bench.run(order)
