"""Errors of runs, with standard errors: one row per run, in the units of the thesis' tables."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

from agvbench.errors import FitError, InputError
from agvbench.statistics.rest_poses import RestPose, end_pose, start_pose
from agvbench.types import Pose, Run, wrap_angle

if TYPE_CHECKING:
    import pandas as pd

_OF_RUN = ("run_id", "experiment", "trajectory", "condition", "repeat", "session", "firmware", "status")
_TARGET = ("target_x_m", "target_y_m", "target_heading_rad")
_END = ("end_x_m", "end_y_m", "end_heading_rad")
COLUMNS = (
    *(*_OF_RUN, "problem", *_TARGET, *_END),
    *("position_mm", "along_mm", "across_mm", "heading_deg", "delta_s_mm", "delta_heading_deg", "rotation_deg"),
    *("stderr_position_mm", "stderr_heading_deg"),
)
_REQUIRED = ("trajectory", "condition", "status", "problem", "position_mm", "delta_heading_deg", "delta_s_mm")


def pose_errors(runs: Iterable[Run] | Run | str | PathLike[str]) -> pd.DataFrame:
    """Return one row per run that has a target: what it is, where it ended, and its errors.

    Columns: those of the runs table; ``problem`` (why the run has no error, else empty); the target and the end
    pose in the start frame [m, rad]; ``position_mm`` (the end position error, not negative); ``along_mm``,
    ``across_mm``, ``heading_deg``, ``delta_s_mm``, ``delta_heading_deg`` (signed; see `PoseError`; the heading error
    and Δδ are one number); ``rotation_deg`` (the rotation made, positive in the target's sense);
    ``stderr_position_mm`` and ``stderr_heading_deg``. Runs that were rejected keep their row; `agvbench.valid` returns
    the rows that count.

    Parameters
    ----------
    runs
        A campaign, its directory, or runs such as ``campaign.select(trajectory="5")``.

    Raises
    ------
    InputError
        If `runs` is none of these.
    CampaignError
        If the campaign cannot be read.
    """
    import pandas as pd

    from agvbench.campaign.arguments import as_runs

    rows = [_row(run) for run in as_runs(runs) if run.target.is_finite]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def as_errors(source: pd.DataFrame | Iterable[Run] | str | PathLike[str], *, where: str) -> pd.DataFrame:
    """Return `source` if it is what `pose_errors` returned, else the errors of the campaign or runs that it is.

    Raises
    ------
    InputError
        If it is neither; `where` is the argument's name.
    CampaignError
        If the campaign cannot be read.
    """
    import pandas as pd

    from agvbench.campaign.arguments import as_runs

    if not isinstance(source, pd.DataFrame):
        return pose_errors(as_runs(source, where=where))
    if missing := [name for name in _REQUIRED if name not in source]:
        remedy = "give a campaign, its directory, or what agvbench.pose_errors returns"
        raise InputError("is not a table of errors", where=where, value=f"no column {missing[0]}", remedy=remedy)
    return source


def valid(errors: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of what `pose_errors` returned whose run counts (status ``ok``) and has an error."""
    return errors[(errors["status"] == "ok") & (errors["problem"] == "")].reset_index(drop=True)


def _row(run: Run) -> dict[str, object]:
    row = {name: getattr(run, name) for name in _OF_RUN} | {"session": run.session or "", "problem": ""}
    row |= dict(zip(_TARGET, run.target, strict=True))
    try:
        return row | _errors(run)
    except FitError as error:
        return row | {"problem": error.what}


def _errors(run: Run) -> dict[str, object]:
    error = pose_error(start_pose(run), end_pose(run), run.target)
    sense = math.copysign(1.0, run.target.heading_rad) if run.target.heading_rad else 1.0
    shown = _in_table_units(error)
    return {
        **dict(zip(_END, error.end, strict=True)),
        **vars(shown),
        "rotation_deg": sense * (math.degrees(run.target.heading_rad) + shown.heading_deg),
        "stderr_position_mm": error.stderr_position_m * 1e3,
        "stderr_heading_deg": math.degrees(error.stderr_heading_rad),
    }


@dataclass(frozen=True)
class PoseError:
    """Where a run ended against where it should have ended; m and rad.

    ``position_m`` is the distance of the end position from the target's, ``along_m`` and ``across_m`` are its
    components along x and y of the start frame. ``delta_s_m`` is ``|end − start| − target distance``, which cannot see
    lateral drift, and ``delta_heading_rad`` the heading change minus the target's, wrapped; both are signed (the
    thesis, section 8.2, reports them without sign). ``end`` is the end pose in the start frame. Standard errors come
    from the frames at rest and say nothing about the dispersion between runs.
    """

    end: Pose
    delta_s_m: float
    delta_heading_rad: float
    along_m: float
    across_m: float
    stderr_position_m: float
    stderr_heading_rad: float

    @property
    def position_m(self) -> float:
        """Return the end position error [m]."""
        return math.hypot(self.along_m, self.across_m)


def pose_error(start: RestPose, end: RestPose, target: Pose) -> PoseError:
    """Return the error of a run from `start` to `end` (floor frame) against `target` (start frame).

    >>> still = dict(stderr_x_m=0.0, stderr_y_m=0.0, stderr_heading_rad=0.0, frames=1, left_out=0)
    >>> error = pose_error(RestPose(Pose(1, 1, math.pi / 2), **still), RestPose(Pose(1, 3.01, math.pi / 2), **still),
    ...                    Pose(2.0, 0.0, 0.0))
    >>> round(error.delta_s_m, 6), round(error.along_m, 6), round(error.across_m, 6)
    (0.01, 0.01, 0.0)
    """
    reached = end.pose.relative_to(start.pose)
    return PoseError(
        end=reached,
        delta_s_m=math.hypot(reached.x_m, reached.y_m) - math.hypot(target.x_m, target.y_m),
        delta_heading_rad=wrap_angle(reached.heading_rad - target.heading_rad),
        along_m=reached.x_m - target.x_m,
        across_m=reached.y_m - target.y_m,
        stderr_position_m=math.hypot(start.stderr_position_m, end.stderr_position_m),
        stderr_heading_rad=math.hypot(start.stderr_heading_rad, end.stderr_heading_rad),
    )


@dataclass(frozen=True)
class RunError:
    """Where a run ended against its target, in the start frame; columns of `pose_errors` have the same names.

    Parameters
    ----------
    position_mm
        End position error: distance from the target position to the end position [mm], not negative.
    along_mm, across_mm
        Its components along x and y of the start frame [mm], signed.
    heading_deg, delta_heading_deg
        Heading change minus that of the target [deg], signed, wrapped to (−180, 180]; both are one number, Δδ.
    delta_s_mm
        Δs, distance from start to end minus distance from start to target [mm], signed.
    """

    position_mm: float
    along_mm: float
    across_mm: float
    heading_deg: float
    delta_s_mm: float
    delta_heading_deg: float

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:.2f}" for name, value in vars(self).items())
        return f"RunError({numbers})"


def run_error(run: Run) -> RunError:
    """Return the error of `run`.

    Raises
    ------
    InputError
        If the run has no target.
    FitError
        If its start or end pose cannot be measured.
    """
    if not run.target.is_finite:
        raise InputError("the run has no target, so no error", where=run.run_id, remedy="drive a trajectory that has")
    return _in_table_units(pose_error(start_pose(run), end_pose(run), run.target))


def _in_table_units(error: PoseError) -> RunError:
    heading_deg = math.degrees(error.delta_heading_rad)
    return RunError(
        position_mm=1e3 * error.position_m,
        along_mm=1e3 * error.along_m,
        across_mm=1e3 * error.across_m,
        heading_deg=heading_deg,
        delta_s_mm=1e3 * error.delta_s_m,
        delta_heading_deg=heading_deg,
    )
