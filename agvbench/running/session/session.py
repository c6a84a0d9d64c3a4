"""A bench session as benchmarks see it: models, workspace, and a driver for each benchmark's runs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from agvbench.bus.state_publisher import StateSource
from agvbench.campaign.attempts import LEAVES_WORKSPACE
from agvbench.campaign.names import controlled_name
from agvbench.control import ControllerFactory, Reference
from agvbench.errors import FitError, FlagError, OneOf, PlanError
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
from agvbench.planning.leg import stops
from agvbench.planning.trajectories.shapes import CommandTable
from agvbench.running.command_shares import Shares, falling, held
from agvbench.running.configuration.provenance import RecordedInputs, trajectory_inputs
from agvbench.running.execution.bench import Bench
from agvbench.running.execution.closed_loop import DEFAULT_PERIOD_S, Control
from agvbench.running.execution.latch import Failure
from agvbench.running.execution.run_records import RunRequest
from agvbench.running.session.driven_run import DrivenRun
from agvbench.running.session.end_pose_bias import NO_BIAS_CORRECTIONS
from agvbench.types import CONDITIONS, Commands, Pose, Run
from agvbench.vehicle.channels import TableUnit


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


_LEAST_SHARE = 0.2
_TRIM_SHARE = 0.06
"""Of full steering: 1.5° of 25°, about what a servo horn is off by half a tooth."""
Steps = Sequence[tuple[float, Mapping[str, float]]]


class NotDrivenError(Exception):
    """Nothing was driven, and that is no failure: a dry run, or an axle that this vehicle does not steer."""


class UndrivableError(NotDrivenError):
    """A trajectory of which an earlier run said that it cannot be driven here."""


class RunRejectedError(PlanError):
    """Every attempt at a run was rejected; all are recorded."""


class Driver:
    """Drives the runs of one benchmark; each returns the recorded run that counts, with its ``error``.

    Parameters
    ----------
    session
        Where to drive.
    run_id
        What the campaign calls the run; in simulation all its randomness follows from this name.
    experiment, repeat
        Columns of the runs table.
    """

    def __init__(self, session: BenchSession, run_id: str, *, experiment: str, repeat: int) -> None:
        self._session, self._run_id = session, run_id
        self._experiment, self._repeat = experiment, repeat

    def trajectory(self, name: str, *, condition: str) -> DrivenRun:
        """Drive the trajectory `name` (shipped, or a TOML file) with the commands that `condition` gives.

        Raises
        ------
        FlagError
            If the condition is unknown.
        PlanError
            If this vehicle cannot drive the trajectory here; nothing moved.
        RunRejectedError
            If no attempt counted.
        LinkError
            If the bus or hardware failed.
        """
        return self._drive(self._planned(name, condition), condition)

    def controlled(
        self,
        name: str,
        make_controller: ControllerFactory,
        *,
        condition: str,
        period_s: float = DEFAULT_PERIOD_S,
        controller_name: str = "",
    ) -> DrivenRun:
        """Drive the trajectory `name` closed loop: a controller commands the vehicle every `period_s` [s].

        `make_controller` makes it for each attempt; `condition` says with which model its motions become commands. The
        run's trajectory is called by both names, such as ``figure_eight-PurePursuit``. Controllers that differ in their
        parameters take a `controller_name`, or they count as repeats of each other.

        Raises
        ------
        ControllerError
            If the controller fails or returns what cannot be commanded; the vehicle was stopped, the run is aborted.
        FlagError, PlanError, RunRejectedError, LinkError
            As `trajectory`, and if `controller_name` or `period_s` cannot be used. A controller that does not end the
            run is rejected.
        """
        planned = self._planned(name, condition)
        control = Control(
            make_controller, Reference(planned, self._session.model(condition)), period_s, controller_name
        )
        with self._planning():
            control.controller(self._run_id)  # what it cannot follow is said before anything moves, or in a dry run
        name = controlled_name(planned.trajectory.name, control.name)
        return self._drive(planned, condition, trajectory=name, control=control)

    def _planned(self, name: str, condition: str) -> Plan:
        if condition not in CONDITIONS:
            raise FlagError("unknown condition", value=condition, limit=OneOf(CONDITIONS), where=self._run_id)
        trajectory = self._session.trajectory(name)
        with self._planning():
            return self._session.plan(trajectory, condition)

    def hold(
        self,
        *,
        for_s: float,
        drive: float = 0.0,
        front: float = 0.0,
        rear: float = 0.0,
        least_s: float | None = None,
        slower: bool = False,
    ) -> DrivenRun:
        """Hold shares of full command for `for_s` seconds: drive 1 is full speed forward, steering 1 full left.

        With `least_s` the time is shortened, down to that, until the path fits the workspace; with `slower` the drive
        is then lowered, without it the run is left out.
        """
        times = [for_s] if least_s is None else falling(for_s, least_s)
        shares = falling(1.0, _LEAST_SHARE)[1:] if slower else []
        tries = [(s, drive) for s in times] + [(times[-1], drive * share) for share in shares]
        steps = [[(s, {"drive": share, "front": front, "rear": rear})] for s, share in tries]
        fitting = next((one for one in steps if self._fits(one)), None)
        if fitting is None and least_s is not None and not slower:
            self._session.not_applicable.add(self._run_id)
            raise NotDrivenError(
                f"too fast for this floor: {least_s:g} s of it do not fit {self._session.workspace.name}"
            )
        return self.steps(fitting or steps[-1])

    def steps(self, steps: Steps) -> DrivenRun:
        """Hold several commands one after another: (duration [s], shares of full command) each."""
        with self._planning():
            planned = self._held(steps)
        return self._drive(planned, "uncalibrated", trajectory="")

    @contextmanager
    def _planning(self) -> Iterator[None]:
        """Take note of a run that has no plan: it is not among those that a campaign lacks."""
        try:
            yield
        except (PlanError, UndrivableError):
            self._session.not_applicable.add(self._run_id)
            raise

    def _fits(self, steps: Steps) -> bool:
        """Return whether the workspace has room for these steps: of a fast vehicle, also with a trim to either side.

        Its long arcs are bent by metres if it steers other than its nominal maps say.
        """
        try:
            made = self._held(steps)
            for bend in (-_TRIM_SHARE, _TRIM_SHARE) if len(stops(made.expected)) else ():
                bent = self._as_trajectory(_bent(steps, bend))
                plan(bent, self._session.nominal, workspace=self._session.workspace, start=made.start)
        except (PlanError, UndrivableError):
            return False
        return True

    def _held(self, steps: Steps) -> Plan:
        if self._session.shares.rear == 0.0 and any(step.get("rear") for _, step in steps):
            self._session.not_applicable.add(self._run_id)
            raise NotDrivenError("this vehicle does not steer its rear axle")
        return self._session.plan(self._as_trajectory(steps), "uncalibrated")

    def _as_trajectory(self, steps: Steps) -> Trajectory:
        nominal, shares = self._session.nominal, self._session.shares
        commands = held(nominal, [(duration_s, shares.command(**step)) for duration_s, step in steps])
        return _as_trajectory(self._experiment, commands, nominal.channels.table_unit)

    def _drive(
        self, planned: Plan, condition: str, *, trajectory: str | None = None, control: Control | None = None
    ) -> DrivenRun:
        request = RunRequest(
            run_id=self._run_id,
            experiment=self._experiment,
            trajectory=planned.trajectory.name if trajectory is None else trajectory,
            condition=condition,
            repeat=self._repeat,
            commands=planned.commands,
            target=planned.target,
            start=planned.start,
            control=control,
        )
        run = self._session.run(request, planned)
        if not run.is_ok:
            bends = "give a larger --workspace, or a vehicle.toml with its trim: the vehicle bends off its planned path"
            remedy = bends if LEAVES_WORKSPACE in str(run.status) else "see the campaign's rejected runs"
            raise RunRejectedError("no attempt counted", where=self._run_id, value=run.status, remedy=remedy)
        self._session.concluded(self._run_id)  # whatever the benchmark says of it then: it was driven
        self._session.last_driven = DrivenRun.of(run)
        return self._session.last_driven


def _bent(steps: Steps, bend: float) -> Steps:
    """Return steps with shares of the front command that are moved by `bend`, within full command."""
    return [
        (duration_s, {**step, "front": max(-1.0, min(1.0, step.get("front", 0.0) + bend))})
        for duration_s, step in steps
    ]


def _as_trajectory(name: str, commands: Commands, unit: TableUnit) -> Trajectory:
    *rows, stop = zip(*(column.tolist() for column in vars(commands).values()), strict=True)
    table = CommandTable(unit=unit, rows=tuple(rows), duration_s=stop[0])
    return Trajectory(schema=1, name=name, target="none", commands=table)
