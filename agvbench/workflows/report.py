"""``agvbench report``: everything a report says about a campaign, as numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.campaign import Campaign, CampaignHeader
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.uncertainty_statement import evaluations
from agvbench.errors import FileError, InputError
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.metrics.table import metrics_of_runs
from agvbench.statistics import Comparison, bias_and_spread, compare_errors, end_pose_table, pose_errors, valid
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM, checked_margins
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.pose_accuracy import completions, pose_accuracies
from agvbench.statistics.uncertainty.end_pose_budgets import EndPoseBudget, end_pose_budgets
from agvbench.types import Frames, Run
from agvbench.workflows.calibration import CalibrationCurves, read_calibration_curves
from agvbench.workflows.comparison.kept import read_comparison
from agvbench.workflows.diagnosis_files import ShownDiagnosis, read_diagnosis
from agvbench.workflows.report_changes import CampaignChanges, changes_since_before, firmware_of

if TYPE_CHECKING:
    import pandas as pd


def run_quality(runs: Sequence[Run], *, rate_hz: float) -> pd.DataFrame:
    """Return one row per run: what it is, its status, and how many frames were tracked, doubled and lost.

    Columns ``run_id``, ``experiment``, ``trajectory``, ``condition``, ``status``, ``frames`` (that arrived),
    ``expected`` (between the first and the last capture time at `rate_hz`), ``tracked`` (distinct capture times
    with a pose), ``doubled``, ``lost_share`` (the share of expected frames that brought no pose) and ``longest_gap_s``
    (NaN below two tracked frames).
    """
    import pandas as pd

    columns = ("run_id", "experiment", "trajectory", "condition", "status")
    rows = [{c: getattr(run, c) for c in columns} | _seen(run.frames, rate_hz) for run in runs]
    return pd.DataFrame(rows)


def _seen(frames: Frames, rate_hz: float) -> dict[str, float]:
    times = np.unique(frames.t_s[np.isfinite(frames.t_s)])
    tracked = np.unique(frames.t_s[frames.tracked.astype(np.bool_)])
    expected = round(float(times[-1] - times[0]) * rate_hz) + 1 if len(times) else 0
    return {
        "frames": len(frames),
        "expected": expected,
        "tracked": len(tracked),
        "doubled": len(frames) - len(times),
        "lost_share": max(0.0, 1.0 - len(tracked) / expected) if expected else float("nan"),
        "longest_gap_s": float(np.max(np.diff(tracked))) if len(tracked) > 1 else float("nan"),
    }


Tracker = Callable[[Iterable[Run], int], Iterator[Run]]


@dataclass(frozen=True)
class ReportData:
    """A campaign and all that was computed from it.

    ``errors`` is what `pose_errors` returns, ``end_poses`` the table of tables 8.3–8.10, ``spread`` accuracy apart from
    repeatability, ``comparisons`` every condition against the next one, ``quality`` one row per run. ``problems`` are
    sentences about what could not be read or compared, ``failures`` the errors of own metrics that cannot be
    evaluated, by name; ``events`` are what adapters reported. ``metrics`` are what `metric_table` returns;
    ``diagnosis`` lies in the directory, or None. ``budgets`` are the uncertainty budgets of
    mean end pose errors, ``accuracy`` what `pose_accuracies` returns and ``completions`` what `completions` does.
    ``changes`` are since the campaign before, or None where there is none. ``compared`` are sentences about the
    comparison that lies in the directory. ``recordings`` are the files of the runs'
    poses, by run id.
    """

    path: Path
    header: CampaignHeader
    runs: list[MeasuredRun]
    errors: pd.DataFrame
    end_poses: pd.DataFrame
    spread: pd.DataFrame
    comparisons: list[Comparison]
    quality: pd.DataFrame
    curves: CalibrationCurves
    events: pd.DataFrame
    metrics: pd.DataFrame
    budgets: list[EndPoseBudget]
    accuracy: pd.DataFrame
    completions: pd.DataFrame
    recordings: Mapping[str, Path]
    provenance: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    failures: Mapping[str, FileError] = field(default_factory=dict)
    diagnosis: ShownDiagnosis | None = None
    changes: CampaignChanges | None = None
    compared: tuple[str, ...] = ()

    @property
    def conditions(self) -> list[str]:
        """Return the conditions of runs with a target, in their usual order."""
        return in_order(self.errors["condition"])


def gather(
    source: Campaign | str | Path,
    *,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    against: Path | None = None,
    uncertainty: Mapping[str, Any] | None = None,
    track: Tracker | None = None,
    on_read: Callable[[Sequence[MeasuredRun]], object] = lambda _: None,
) -> ReportData:
    """Read a campaign and compute what a report says about it.

    Parameters
    ----------
    source
        A campaign, or its directory.
    margin_mm, margin_deg
        The noise band of comparisons between conditions.
    against
        The campaign to list differences from; without it, the last earlier one of this vehicle in the same folder.
    uncertainty
        What the lab states, as `agvbench.campaign.uncertainty_statement.read_statement` returns it; without it, what
        the campaign's header has.
    track
        Wraps the runs while they are read, to show progress: called with the runs and their number.
    on_read
        Called with the runs once they are read.

    Raises
    ------
    CampaignError
        If the campaign, or `against`, cannot be read.
    FlagError
        If a margin is negative or not finite.
    """
    checked_margins(margin_mm, margin_deg)
    campaign = as_campaign(source)
    tracked = track(campaign, len(campaign)) if track else iter(campaign)
    runs = list(map(PlannedPaths(campaign).measured, tracked))
    on_read(runs)
    errors = pose_errors(runs)
    problems: list[str] = []
    failures = dict[str, FileError]()
    metrics = metrics_of_runs(runs, failures)
    problems += [f"The metric {name} is left out: {error}" for name, error in failures.items()]
    return ReportData(
        path=campaign.path,
        header=campaign.header,
        runs=runs,
        errors=errors,
        end_poses=end_pose_table(errors, thesis_vehicle=_is_thesis_vehicle(campaign.header)),
        spread=bias_and_spread(errors),
        comparisons=_between_conditions(errors, margin_mm, margin_deg, problems),
        quality=run_quality(runs, rate_hz=campaign.header.mocap_rate_hz),
        curves=read_calibration_curves(campaign),
        events=reported_events(campaign, problems),
        metrics=metrics,
        budgets=end_pose_budgets(
            runs, evaluations(campaign.header.uncertainty if uncertainty is None else uncertainty)
        ),
        accuracy=pose_accuracies(errors),
        completions=completions(errors),
        recordings={run.run_id: campaign.recording(run.run_id) for run in runs},
        provenance=_provenance(campaign, problems),
        problems=problems,
        failures=failures,
        diagnosis=read_diagnosis(campaign.path),
        compared=read_comparison(campaign.path),
        changes=changes_since_before(
            campaign.path, against, firmware=firmware_of(run.firmware for run in runs), metrics=metrics
        ),
    )


def _is_thesis_vehicle(header: CampaignHeader) -> bool:
    """Return whether axle distances and command units are those of the vehicle that the thesis drove."""
    from agvbench.model import thesis_vehicle

    model = thesis_vehicle()
    axles = (header.front_axle_m, header.rear_axle_m)
    near = all(map(math.isclose, axles, (model.geometry.front_axle_m, model.geometry.rear_axle_m)))
    return near and header.channels.table_unit == model.channels.table_unit


def _between_conditions(
    errors: pd.DataFrame, margin_mm: float, margin_deg: float, problems: list[str]
) -> list[Comparison]:
    comparisons = []
    for pair in pairwise(in_order(valid(errors)["condition"])):
        try:
            comparisons.append(
                compare_errors(
                    errors,
                    errors,
                    margin_mm=margin_mm,
                    margin_deg=margin_deg,
                    conditions=pair,
                    same_campaign=True,
                    names=pair,
                )
            )
        except InputError:
            problems.append(f"{pair[0]} and {pair[1]} cannot be compared: no trajectory was driven under both.")
    return comparisons


EVENT_COLUMNS = ("time_s", "run_id", "source", "level", "event", "text")


def reported_events(campaign: Campaign, problems: list[str]) -> pd.DataFrame:
    """Return what adapters and link reported, no rows where the campaign does not say; `problems` get what is wrong."""
    import pandas as pd

    nothing = pd.DataFrame(columns=list(EVENT_COLUMNS))
    if not campaign.has_table("events"):
        return nothing
    try:
        return campaign.table("events")[list(EVENT_COLUMNS)]
    except (InputError, KeyError) as error:
        problems.append(f"The events table cannot be read: {error}.")
        return nothing


def _provenance(campaign: Campaign, problems: list[str]) -> dict[str, str]:
    """Return the provenance table, if there is one, as names and values."""
    if not campaign.has_table("provenance"):
        return {}
    try:
        table = campaign.table("provenance")
        return {str(row["name"]): str(row["value"]) for row in table.to_dict("records")}
    except (InputError, KeyError) as error:
        problems.append(f"The provenance table cannot be read: {error}.")
        return {}
