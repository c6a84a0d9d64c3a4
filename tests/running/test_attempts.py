"""Which runs that do not count are failures of the vehicle: with the statuses that the bench writes."""

import math

import numpy as np
import pytest

from agvbench.campaign.attempts import Attempt, attempt_of
from agvbench.errors import AdapterGoneError, ControllerError
from agvbench.planning import Workspace
from agvbench.running.execution.run_records import RunRequest, aborted_run
from agvbench.running.quality import Quality
from agvbench.running.supervision.limits import DEFAULT_SAFETY
from agvbench.running.supervision.rule import Slice
from agvbench.running.supervision.rules.volume import VolumeRule
from agvbench.running.supervision.supervisor import safety_stop
from agvbench.types import Commands, Frames, Outcome, Pose, RunStatus

COMMANDS = Commands(np.zeros(1), np.full(1, 1500.0), np.full(1, 1500.0), np.full(1, 1500.0))
REQUEST = RunRequest("r1", "trajectory", "5", "calibrated", 1, COMMANDS, Pose(1.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0))
GOOD = Quality(1.0, 0.0, 0.0, 0.0, rests_before=True, rests_after=True)


def frames(x_m, n=9):
    times = np.arange(n) / 30.0
    return Frames(
        times, np.full(n, x_m), np.zeros(n), np.zeros(n), np.ones(n, dtype=bool), np.arange(n), np.full(n, 4e-4),
        times + 0.01,
    )  # fmt: skip


def aborted(error):
    """Return the attempt of a run that `error` ended, by the status that is recorded."""
    return attempt_of(aborted_run(REQUEST, "r1-aborted1", 0.0, error, frames(0.0), "").status)


def test_a_vehicle_that_leaves_the_workspace_did_not_complete_its_attempt():
    rule = VolumeRule(DEFAULT_SAFETY, Workspace.circle(6.1))
    what, value, limit = rule.complaint(Slice.of(frames(5.0), 0.3, 0.3))
    stop = safety_stop(0.3, what, where="lab/agv", value=value, limit=limit, ends_session=rule.ends_session)
    assert attempt_of(str(RunStatus(Outcome.REJECTED, str(stop)))) is Attempt.NOT_COMPLETED


@pytest.mark.parametrize(
    ("change", "became"),
    [
        ({}, Attempt.COMPLETED),
        ({"rests_after": False}, Attempt.NOT_COMPLETED),
        ({"rests_before": False}, Attempt.NONE),
        ({"tracked_share": 0.5}, Attempt.NONE),
        ({"longest_gap_s": 0.4}, Attempt.NONE),
        ({"start_position_error_m": math.nan}, Attempt.NONE),
    ],
)
def test_quality_rejects_for_the_recording_or_for_a_vehicle_that_does_not_stop(change, became):
    assert attempt_of(Quality(**{**vars(GOOD), **change}).status()) is became


@pytest.mark.parametrize(
    ("error", "became"),
    [
        (KeyboardInterrupt(), Attempt.NONE),
        (AdapterGoneError("the agv adapter vanished", where="lab/agv", value="1.0 s ago"), Attempt.NONE),
        (safety_stop(1.0, "tracking is frozen", where="lab/agv", value="the same pose for 0.60 s"), Attempt.NONE),
        (safety_stop(1.0, "pose jumped", where="lab/agv", value="0.50 m"), Attempt.NONE),
        (safety_stop(1.0, "camera's clock was set back", where="lab/agv", value="0.50 s"), Attempt.NONE),
        (ControllerError("raised ZeroDivisionError", where="r1: mine"), Attempt.NOT_COMPLETED),
    ],
)
def test_aborted_runs_count_against_the_vehicle_unless_something_else_ended_them(error, became):
    assert aborted(error) is became
