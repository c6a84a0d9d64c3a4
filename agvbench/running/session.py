"""What benchmarks see of a bench session: models, workspace, and drivers for their runs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from agvbench.errors import FitError, PlanError
from agvbench.model import VehicleModel
from agvbench.planning import (
    NOTHING_LEFT,
    Departure,
    Plan,
    Trajectory,
    Workspace,
    corrected_plan,
    depends_on_time,
    load_trajectory,
    plan,
    steered,
)
from agvbench.running.bench import Bench
from agvbench.running.constant import Shares
from agvbench.running.driver import Driver, NotDrivenError, UndrivableError
from agvbench.running.latch import Failure
from agvbench.running.provenance import RecordedInputs, trajectory_inputs
from agvbench.running.records import DriveOrder
from agvbench.running.remainders import NO_REMAINDERS
from agvbench.types import Pose, Run


class BenchSession:
    """A session that drives with `bench` or, where that is None, a dry run that plans everything and drives nothing.

    ``models`` are those known before anything is driven, by condition; a dry run needs one of each. ``remainders`` is
    what the corrected one still misses, by trajectory; ``steering`` the mode in which all are steered, "" for each its
    own. ``inputs`` records the files of the trajectories that are driven.
    """

    def __init__(
        self,
        directory: Path,
        *,
        models: Mapping[str, VehicleModel],
        workspace: Workspace,
        bench: Bench | None,
        remainders: Mapping[str, Pose] = NO_REMAINDERS,
        steering: str = "",
        inputs: RecordedInputs | None = None,
    ) -> None:
        self.directory, self.workspace = directory, workspace
        self.nominal = models["uncalibrated"]
        self.shares = Shares.of_model(self.nominal)
        self.planned: list[tuple[DriveOrder, Plan]] = []
        self._models, self._bench, self._remainders, self._steering = models, bench, remainders, steering
        self._inputs = inputs
        self._plans: dict[tuple[Trajectory, str], Plan] = {}
        self._undrivable: dict[tuple[Trajectory, str], PlanError] = {}
        self._not_calibrated: FitError | None = None
        self._hourly: set[tuple[Trajectory, str]] = set()
        self.notices: list[str] = []
        self.not_applicable: set[str] = set()
        """The ids of runs that this vehicle cannot drive here."""
        self.done: set[str] = set()
        """The ids of runs that an earlier session finished."""

    @property
    def is_dry(self) -> bool:
        """Whether nothing is driven."""
        return self._bench is None

    @property
    def failure(self) -> Failure | None:
        """What ended the driving before its time, if anything did."""
        return None if self._bench is None else self._bench.failure

    def expect(self, run_ids: Collection[str], calibration: Collection[str]) -> None:
        """Take note of the runs that were chosen, and of those among them that calibrate: all are awaited."""
        if self._bench is not None:
            self.done = self._bench.done(run_ids)
            self._bench.expect_calibration(calibration)
            if self._bench.is_resumed:
                self.notices.append(self._bench.outlook(run_ids))

    def concluded(self, run_id: str) -> None:
        """Take note of a run that was driven, rejected for good, or cannot be driven: it is awaited no more."""
        if self._bench is not None:
            self._bench.awaited.discard(run_id)

    @property
    def events(self) -> list[str]:
        """What adapters and link reported in this session: a line for each kind, with how often it came."""
        return [] if self._bench is None else self._bench.log.summary()

    def model(self, condition: str) -> VehicleModel:
        """Return the vehicle model that commands are computed with under `condition`."""
        return self._models[condition] if self._bench is None else self._bench.model(condition)

    def trajectory(self, name: str) -> Trajectory:
        """Return the trajectory of this name or file, steered as the session is, or as the vehicle can.

        Raises
        ------
        FileError
            If there is no such trajectory, or its file has changed since the session began.
        RecordingError
            If the hash of its file cannot be recorded.
        """
        if self._inputs is not None:
            self._inputs.add(trajectory_inputs([name]))
        return steered(load_trajectory(name), self._steering, self.nominal)

    def plan(self, trajectory: Trajectory, condition: str) -> Plan:
        """Return the plan of `trajectory` under `condition`: made once, driven in every repeat.

        Under ``"corrected"`` it makes up for the model's effects, and is made anew for every run if one of them
        depends on how long the session lasts.

        Raises
        ------
        PlanError
            If the vehicle cannot drive it, or not inside the workspace.
        NotDrivenError
            If that was said before.
        LinkError
            If the bench drives no more.
        """
        if self._bench is not None:
            self._bench.check()
        key = (trajectory, condition)
        if key in self._undrivable:
            raise UndrivableError(f"cannot be driven, as its first repeat says: {self._undrivable[key]}")
        if key not in self._plans:
            try:
                self._plans[key] = self._planned(trajectory, condition)
            except PlanError as error:
                self._undrivable[key] = error
                raise
        if key in self._hourly:
            return self._planned(trajectory, condition)
        return self._plans[key]

    def _planned(self, trajectory: Trajectory, condition: str) -> Plan:
        model = self._model_to_drive(condition)
        if condition != "corrected":
            return plan(trajectory, model, workspace=self.workspace)
        departure = Departure() if self._bench is None else self._bench.departure
        missed = self._remainders.get(trajectory.name, NOTHING_LEFT)
        made = corrected_plan(trajectory, model, workspace=self.workspace, departure=departure, remainder=missed)
        if depends_on_time(made, model, departure):
            self._hourly.add((trajectory, condition))
        return made

    def _model_to_drive(self, condition: str) -> VehicleModel:
        if condition == "calibrated" and self._not_calibrated is not None:
            raise NotDrivenError(f"not calibrated, as the first such run says: {self._not_calibrated}")
        try:
            return self.model(condition)
        except FitError as error:
            self._not_calibrated = error
            raise

    def driver(self, run_id: str, *, experiment: str, repeat: int) -> Driver:
        """Return what drives the run `run_id`."""
        return Driver(self, run_id, experiment=experiment, repeat=repeat)

    def run(self, order: DriveOrder, planned: Plan) -> Run:
        """Drive `order`; in a dry run only note it.

        Raises
        ------
        NotDrivenError
            In a dry run.
        """
        if self._bench is None:
            self.planned.append((order, planned))
            raise NotDrivenError("dry run")
        return self._bench.run(order)
