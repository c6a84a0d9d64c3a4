"""The vehicle as it drives now, from the states of its runner: pose, path so far, plan, commands and faults."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from agvbench.bus.messages.runner_state import Phase, RunnerState
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.planning import Plan
from agvbench.reporting.content import plain, plain_sentences
from agvbench.reporting.viewer.blueprint import LIVE
from agvbench.reporting.viewer.run_entities import FAULTS, PLANNED, arrow, line
from agvbench.types import Command, Pose

if TYPE_CHECKING:
    import rerun as rr

_SESSION = "session_time"
_DRIVEN = (230, 120, 20)


class LiveVehicle:
    """Sends states to `recording` as they come, on the timeline ``session_time``."""

    def __init__(self, recording: rr.RecordingStream) -> None:
        import rerun as rr

        self._recording = recording
        self._run = self._phase = ""
        self._driven: list[Pose] = []
        self._command: Command | None = None
        self._faults = 0
        recording.log(f"{LIVE}/vehicle", arrow(Pose(0.0, 0.0, 0.0), _DRIVEN, 0.015), static=True)
        recording.log(f"{LIVE}/command", rr.SeriesLines(names=list(Command._fields)), static=True)

    def show(self, state: RunnerState, plans: PlannedPaths | None) -> None:
        """Send a state; `plans` where the campaign has any yet."""
        self._recording.set_time(_SESSION, duration=state.elapsed_s)
        self._log_phase(state)
        if state.command is not None:
            self._log_command(state.command, state.elapsed_s)
        if state.pose is not None:
            self._log_pose(state, state.pose, plans)

    def _log_phase(self, state: RunnerState) -> None:
        import rerun as rr

        run = state.run.run_id if state.run else ""
        if (phase := f"{state.phase.value} {plain(run)}".strip()) != self._phase:
            self._phase = phase
            self._recording.log(f"{LIVE}/phase", rr.TextLog(phase))
        for fault in state.faults_since(self._faults):
            self._recording.log(f"{FAULTS}/live", rr.TextLog(plain_sentences(fault), level="WARN"))
        self._faults = state.fault_count

    def _log_command(self, command: Command, now_s: float) -> None:
        """Send a held command as a step: its predecessor again, at the same time."""
        import rerun as rr

        if self._command is not None and self._command != command:
            self._recording.set_time(_SESSION, duration=now_s - 1e-6)
            self._recording.log(f"{LIVE}/command", rr.Scalars(list(self._command)))
            self._recording.set_time(_SESSION, duration=now_s)
        self._command = command
        self._recording.log(f"{LIVE}/command", rr.Scalars(list(command)))

    def _log_pose(self, state: RunnerState, pose: Pose, plans: PlannedPaths | None) -> None:
        import rerun as rr

        half = pose.heading_rad / 2.0
        turn = rr.Quaternion(xyzw=[0.0, 0.0, math.sin(half), math.cos(half)])
        self._recording.log(f"{LIVE}/vehicle", rr.Transform3D(translation=[*pose[:2], 0.0], quaternion=turn))
        if state.run is None or state.phase not in (Phase.DRIVING, Phase.SETTLING):
            return
        if state.run.run_id != self._run:
            self._run, self._driven = state.run.run_id, []
            self._log_plan(pose, None if plans is None else _plan(plans, state.run.trajectory))
        self._driven.append(pose)
        self._recording.log(f"{LIVE}/path", line(np.array(self._driven)[:, :2], _DRIVEN, 0.006))

    def _log_plan(self, start: Pose, plan: Plan | None) -> None:
        """Send plan and target of the run that begins at `start`; clear them where there is no plan."""
        import rerun as rr

        if plan is None:
            for name in ("plan", "target"):
                self._recording.log(f"{LIVE}/{name}", rr.Clear(recursive=False))
            return
        self._recording.log(f"{LIVE}/plan", line(start.place(plan.expected[:, 1:3]), PLANNED, 0.003))
        self._recording.log(f"{LIVE}/target", arrow(start.compose(plan.target), PLANNED, 0.01))


def _plan(plans: PlannedPaths, name: str) -> Plan | None:
    """Return the plan of a run's trajectory; in closed loop, a controller's name follows that of the trajectory."""
    return plans.plan(name) or plans.plan(name.rpartition("-")[0])
