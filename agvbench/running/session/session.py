"""A bench session: models, workspace, plans, and a driver for each benchmark's runs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from agvbench.bus.state_publisher import StateSource
from agvbench.errors import FitError, PlanError
from agvbench.model import VehicleModel
from agvbench.planning import (
    NO_BIAS,
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
from agvbench.running.command_shares import Shares
from agvbench.running.configuration.provenance import RecordedInputs, trajectory_inputs
from agvbench.running.execution.bench import Bench
from agvbench.running.execution.latch import Failure
from agvbench.running.execution.run_records import RunRequest
from agvbench.running.session.driven_run import DrivenRun
from agvbench.running.session.driver import Driver, NotDrivenError, UndrivableError
from agvbench.running.session.end_pose_bias import NO_BIAS_CORRECTIONS
from agvbench.types import Pose, Run


class BenchSession:
    """A session that drives with `bench` or, where that is None, a dry run that plans everything and drives nothing.

    ``models`` are those known before anything is driven, by condition; a dry run needs one of each.
    ``bias_corrections`` are its end-pose biases, by trajectory; ``steering`` is the mode in which all are steered, ""
    for each its own. ``inputs`` records the files of the trajectories that are driven.
    """

    def __init__(
        self,
        directory: Path,
        *,
        models: Mapping[str, VehicleModel],
        workspace: Workspace,
        bench: Bench | None,
        bias_corrections: Mapping[str, Pose] = NO_BIAS_CORRECTIONS,
        steering: str = "",
        inputs: RecordedInputs | None = None,
    ) -> None:
        self.directory, self.workspace = directory, workspace
        self.nominal = models["uncalibrated"]
        self.shares = Shares.of_model(self.nominal)
        self.planned: list[tuple[RunRequest, Plan]] = []
        self._models, self._bench, self._bias_corrections, self._steering = models, bench, bias_corrections, steering
        self._inputs = inputs
        self._plans: dict[tuple[Trajectory, str], Plan] = {}
        self._undrivable: dict[tuple[Trajectory, str], PlanError] = {}
        self._not_calibrated: FitError | None = None
        self._hourly: set[tuple[Trajectory, str]] = set()
        self.notices: list[str] = []
        self.not_applicable: set[str] = set()
        """The ids of runs that this vehicle cannot drive here."""
        self.not_needed: set[str] = set()
        """The ids of runs that are left out because what they were planned for is known."""
        self.last_driven: DrivenRun | None = None
        """The last run that counts."""
        self.done: set[str] = set()
        """The ids of runs that an earlier session finished."""

    @property
    def is_dry(self) -> bool:
        """Whether nothing is driven."""
        return self._bench is None

    @property
    def state(self) -> StateSource | None:
        """What returns the state of a session in real time; None in a simulation, whose runs are over at once."""
        return None if self._bench is None or self._bench.is_lock_step else self._bench.status.state

    @property
    def failure(self) -> Failure | None:
        """What ended the driving before its time, if anything did."""
        return None if self._bench is None else self._bench.failure

    def expect(self, run_ids: Collection[str], calibration: Collection[str]) -> None:
        """Take note of the runs that were chosen, and of those among them that calibrate: all are awaited."""
        if self._bench is not None:
            self.done = self._bench.done(run_ids)
            self._bench.status.expect(run_ids)
            self._bench.expect_calibration(calibration)
            if self._bench.is_resumed:
                self.notices.append(self._bench.outlook(run_ids))

    def concluded(self, run_id: str) -> None:
        """Take note of a run that was driven, rejected for good, or cannot be driven: it is awaited no more."""
        if self._bench is not None:
            self._bench.awaited.discard(run_id)

    def write_beside(self, name: str, write: Callable[[Path], object]) -> None:
        """Have `write` write a further file of the campaign; not in a dry run.

        Raises
        ------
        RecordingError
            If the disk refuses.
        """
        if self._bench is not None:
            self._bench.writer.write_beside(name, write)

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

        Under ``"corrected"`` it compensates for the model's effects, and is made anew for every run if one of them
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
        bias = self._bias_corrections.get(trajectory.name, NO_BIAS)
        made = corrected_plan(trajectory, model, workspace=self.workspace, departure=departure, end_pose_bias=bias)
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

    def run(self, request: RunRequest, planned: Plan) -> Run:
        """Drive `request`; in a dry run only note it.

        Raises
        ------
        NotDrivenError
            In a dry run.
        """
        if self._bench is None:
            self.planned.append((request, planned))
            raise NotDrivenError("dry run")
        return self._bench.run(request)
