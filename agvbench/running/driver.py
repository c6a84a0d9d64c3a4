"""What a benchmark drives with: trajectories under a condition, or commands as shares of full command."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from agvbench.errors import FlagError, PlanError
from agvbench.planning import Plan, Trajectory
from agvbench.planning.trajectories.shapes import CommandTable
from agvbench.running.constant import falling, held
from agvbench.running.records import DriveOrder
from agvbench.types import CONDITIONS, Commands, CommandUnit, Run

_LEAST_SHARE = 0.2

if TYPE_CHECKING:
    from agvbench.running.session import BenchSession


class NotDrivenError(Exception):
    """Nothing was driven, and that is no failure: a dry run, or an axle that this vehicle does not steer."""


class UndrivableError(NotDrivenError):
    """A trajectory of which an earlier run said that it cannot be driven here."""


class RunRejectedError(PlanError):
    """Every attempt at a run was rejected; all are recorded."""


class Driver:
    """Drives the runs of one benchmark; each returns the recorded run that counts.

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

    def trajectory(self, name: str, *, condition: str) -> Run:
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
        if condition not in CONDITIONS:
            raise FlagError("unknown condition", value=condition, limit=", ".join(CONDITIONS), where=self._run_id)
        trajectory = self._session.trajectory(name)
        with self._planning():
            planned = self._session.plan(trajectory, condition)
        return self._drive(planned, condition)

    def hold(
        self,
        *,
        for_s: float,
        drive: float = 0.0,
        front: float = 0.0,
        rear: float = 0.0,
        least_s: float | None = None,
        slower: bool = False,
    ) -> Run:
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

    def steps(self, steps: Sequence[tuple[float, Mapping[str, float]]]) -> Run:
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

    def _fits(self, steps: Sequence[tuple[float, Mapping[str, float]]]) -> bool:
        try:
            self._held(steps)
        except (PlanError, UndrivableError):
            return False
        return True

    def _held(self, steps: Sequence[tuple[float, Mapping[str, float]]]) -> Plan:
        shares = self._session.shares
        if shares.rear == 0.0 and any(step.get("rear") for _, step in steps):
            self._session.not_applicable.add(self._run_id)
            raise NotDrivenError("this vehicle does not steer its rear axle")
        commands = held(shares.neutral, [(duration_s, shares.command(**step)) for duration_s, step in steps])
        trajectory = _as_trajectory(self._experiment, commands, self._session.nominal.command_unit)
        return self._session.plan(trajectory, "uncalibrated")

    def _drive(self, planned: Plan, condition: str, *, trajectory: str | None = None) -> Run:
        order = DriveOrder(
            run_id=self._run_id,
            experiment=self._experiment,
            trajectory=planned.trajectory.name if trajectory is None else trajectory,
            condition=condition,
            repeat=self._repeat,
            commands=planned.commands,
            target=planned.target,
            start=planned.start,
        )
        run = self._session.run(order, planned)
        if not run.is_ok:
            raise RunRejectedError(
                "no attempt counted", where=self._run_id, value=run.status, remedy="see the campaign's rejected runs"
            )
        return run


def _as_trajectory(name: str, commands: Commands, unit: CommandUnit) -> Trajectory:
    *rows, stop = zip(*(column.tolist() for column in vars(commands).values()), strict=True)
    table = CommandTable(unit=unit, rows=tuple(rows), duration_s=stop[0])
    return Trajectory(schema=1, name=name, target="none", commands=table)
