"""What drives the runs of one benchmark: along a trajectory, with a controller, or holding commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from agvbench.campaign.attempts import LEAVES_WORKSPACE
from agvbench.campaign.names import controlled_name
from agvbench.control import ControllerFactory, Reference
from agvbench.errors import FlagError, OneOf, PlanError
from agvbench.planning import Plan, Trajectory, plan
from agvbench.planning.leg import stops
from agvbench.planning.trajectories.shapes import CommandTable
from agvbench.running.command_shares import falling, held
from agvbench.running.execution.closed_loop import DEFAULT_PERIOD_S, Control
from agvbench.running.execution.run_records import RunRequest
from agvbench.running.session.driven_run import DrivenRun
from agvbench.types import CONDITIONS

if TYPE_CHECKING:
    from agvbench.running.session.session import BenchSession

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
        *rows, stop = zip(*(column.tolist() for column in vars(commands).values()), strict=True)
        table = CommandTable(unit=nominal.channels.table_unit, rows=tuple(rows), duration_s=stop[0])
        return Trajectory(schema=1, name=self._experiment, target="none", commands=table)

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
