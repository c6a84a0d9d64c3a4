"""Attempts: whether the vehicle did not complete a run, or something else ended it, by the status of the run.

Statuses are texts (`agvbench.types.RunStatus`), also in campaigns of other programs. The reasons that agvbench writes
for a vehicle's own failures are the constants here, so that those that write them and those that read them agree.
"""

from __future__ import annotations

from enum import StrEnum

from agvbench.types import Outcome, RunStatus

LEAVES_WORKSPACE = "vehicle is leaving the capture volume"
STILL_MOVING = "still moving when the run ended"
CONTROLLER_NEVER_ENDS = "did not end the run"
_FAILURES = (LEAVES_WORKSPACE, STILL_MOVING, CONTROLLER_NEVER_ENDS)
INTERRUPTED = "interrupted"
CAMERA_AHEAD, CAMERA_SET_BACK = "camera's clock is ahead", "camera's clock was set back"
CAMERA_FROZEN, POSE_JUMPED = "tracking is frozen", "pose jumped"
_MEASUREMENT = (CAMERA_AHEAD, CAMERA_SET_BACK, CAMERA_FROZEN, POSE_JUMPED, "mocap adapter")
_INSTALLATION = ("adapter does not answer", "adapter vanished", "no answer", "the bus ", "on the bus", "simulator")


class Attempt(StrEnum):
    """What became of an attempt: completed, not completed by the vehicle, or stopped or rejected for other causes."""

    COMPLETED = "completed"
    NOT_COMPLETED = "not completed"
    NONE = "no attempt"


def attempt_of(status: str) -> Attempt:
    """Return what the status of a run says about its attempt.

    A run that is rejected counts against the vehicle only for the vehicle's own failures. A run that is aborted counts
    against it unless the operator, the camera or the installation ended it: an unknown cause is the vehicle's.

    >>> attempt_of("rejected: gap of 0.40 s without pose (limit: 0.25 s)")
    <Attempt.NONE: 'no attempt'>
    >>> attempt_of("aborted: bumper")
    <Attempt.NOT_COMPLETED: 'not completed'>
    """
    try:
        parsed = RunStatus.parse(status)
    except ValueError:
        return Attempt.NONE
    if parsed.outcome is Outcome.OK:
        return Attempt.COMPLETED
    is_failure = any(reason in parsed.reason for reason in _FAILURES)
    if parsed.outcome is Outcome.ABORTED:
        others = parsed.reason == INTERRUPTED or any(
            cause in parsed.reason for cause in (*_MEASUREMENT, *_INSTALLATION)
        )
        is_failure = is_failure or not others
    return Attempt.NOT_COMPLETED if is_failure else Attempt.NONE
