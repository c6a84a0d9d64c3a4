"""The error that says why a vehicle was stopped, and how its runs are known afterwards."""

from __future__ import annotations

from agvbench.errors import RunStoppedError, SafetyStopError

STOPPED = " s into the run: "
"""What every such error says, and so the status of every run that ended with one."""


def safety_stop(
    at_s: float, why: str, *, where: str, value: str, limit: str | None = None, ends_session: bool = True
) -> SafetyStopError:
    """Return the error of a vehicle that was stopped `at_s` [s] after its run began, or 0 before that.

    Where the stop does not end the session it is a `RunStoppedError`.
    """
    if not ends_session:
        return RunStoppedError(f"stopped {at_s:.1f}{STOPPED}{why}", where=where, value=value, limit=limit)
    return SafetyStopError(
        f"stopped {at_s:.1f}{STOPPED}{why}", where=where, value=value, limit=limit,
        remedy="look at vehicle and camera, then go on with --resume",
    )  # fmt: skip
