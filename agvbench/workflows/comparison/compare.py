"""``agvbench compare`` and `agvbench.compare`: two campaigns, or two conditions of one, against each other."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, TypeAlias

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.names import as_text
from agvbench.errors import FlagError, InputError
from agvbench.metrics.registry import named_metric
from agvbench.metrics.table import by_run, metric_table
from agvbench.statistics import Comparison, compare_errors
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.differences import ALPHA
from agvbench.statistics.intervals import RESAMPLES
from agvbench.statistics.quantities import END_POSE, Quantity
from agvbench.statistics.run_errors import as_errors
from agvbench.workflows.comparison.comparability import comparability, is_same_campaign

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.types import Run

Comparable: TypeAlias = "Campaign | str | PathLike[str] | Iterable[Run] | pd.DataFrame"
_SAME_CAMPAIGN = "both sides are the same campaign: no difference can be found"


def compare(
    a: Comparable,
    b: Comparable | None = None,
    *,
    conditions: Sequence[str] | None = None,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    deciding: Collection[Quantity] = END_POSE,
    metrics: Sequence[str] = (),
    names: tuple[str, str] | None = None,
    same_campaign: bool = False,
    across_vehicles: bool = False,
    alpha: float = ALPHA,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Comparison:
    """Compare the errors of `b` with those of `a`, or two conditions of `a`: end position, heading and |Δs|.

    ``Comparison.notes`` are those that ``agvbench compare`` prints: whether vehicles, plants, cameras, trajectories and
    calibrations differ, and what the intervals cover. They change no verdict.

    Parameters
    ----------
    a, b
        Campaigns, their directories, runs, or what `agvbench.pose_errors` returns. Without `b`, two conditions of `a`
        are compared. Runs that were rejected or could not be measured do not count. Runs and tables of errors contain
        nothing about vehicle, camera and calibration; only campaigns give notes on these.
    conditions
        Compare the first condition of `a` with the second of `b` (of `a` without `b`); by default equal conditions are
        compared.
    margin_mm, margin_deg
        The noise band, of end position error and |Δs|, and of the heading error: median differences within it are no
        regression, however significant.
    deciding
        The quantities that decide whether something is worse (`agvbench.statistics.quantities`); the others are notes.
    metrics
        Names of further metrics that are compared and decide, too (`agvbench.metrics`); they need campaigns.
    names
        What to call the two sides; by default their directories, or the conditions.
    same_campaign
        Two tables of errors come from the same campaign, so that runs are compared within its sessions.
    across_vehicles
        Vehicles that take commands in different units are compared on purpose.
    alpha
        The chance of reporting any regression where there is none, over all trajectories and the quantities that
        decide; notes have the same chance of their own.
    resamples, seed
        Of the bootstrap.

    Raises
    ------
    InputError
        If a side is neither a campaign, nor runs, nor a table of errors, there is nothing in common, or a side has no
        run that counts.
    CampaignError
        If a campaign cannot be read.
    FlagError
        If a margin is negative or not finite, or there is nothing to compare with.
    """
    one, other = _side(a, "a"), None if b is None else _side(b, "b")
    pair = _checked(conditions)
    if other is None and pair is None:
        raise _alone(one)
    further = _further(metrics)
    is_same = _are_same(one, other)
    errors_a = _errors(one, further, "a")
    compared = compare_errors(
        errors_a,
        errors_a if other is None else _errors(other, further, "b"),
        margin_mm=margin_mm,
        margin_deg=margin_deg,
        conditions=pair,
        same_campaign=same_campaign or other is None or is_same,
        deciding=deciding,
        further=further,
        names=names or _names(one, other, pair),
        alpha=alpha,
        resamples=resamples,
        seed=seed,
    )
    _require_measured(compared, further)
    is_itself = is_same and (pair is None or pair[0] == pair[1])
    return _with_notes(compared, one, other, is_itself=is_itself, across_vehicles=across_vehicles)


def _are_same(a: Campaign | pd.DataFrame, b: Campaign | pd.DataFrame | None) -> bool:
    """Return whether two sides are one campaign."""
    return isinstance(a, Campaign) and isinstance(b, Campaign) and is_same_campaign(a, b)


def _require_measured(compared: Comparison, further: Mapping[Quantity, float]) -> None:
    """Raise `InputError` if a metric that decides was measured nowhere on both sides."""
    measured = {difference.quantity for difference in compared.differences}
    for quantity in further:
        if quantity not in measured:
            raise InputError(
                "was not measured on both sides of any trajectory", where="--metrics", value=quantity.column,
                remedy="leave it out, or see what a campaign has with agvbench report",
            )  # fmt: skip


def _side(side: Comparable, where: str) -> Campaign | pd.DataFrame:
    if isinstance(side, Campaign | str | PathLike):
        return as_campaign(side)
    return as_errors(side, where=where)


def _further(metrics: Sequence[str]) -> dict[Quantity, float]:
    """Return the quantities of these metrics with their margins."""
    found = [named_metric(name, where="metrics") for name in metrics]
    return {Quantity(m.name, m.title, m.unit, m.title, m.digits): m.margin for m in found}


def _errors(side: Campaign | pd.DataFrame, further: Mapping[Quantity, float], where: str) -> pd.DataFrame:
    """Return the errors of a side, with a column for each of the `further` metrics."""
    errors = as_errors(side, where=where)
    if not further:
        return errors
    if not isinstance(side, Campaign):
        missing = [q.column for q in further if q.column not in errors]
        if missing:
            raise InputError("has no such metric", where=where, value=missing[0], remedy="give a campaign")
        return errors
    columns = ["run_id", *(q.column for q in further)]
    return errors.merge(by_run(metric_table(side)).reindex(columns=columns), on="run_id", how="left")


def _checked(conditions: Sequence[str] | None) -> tuple[str, str] | None:
    if conditions is None:
        return None
    if isinstance(conditions, str) or len(conditions) != 2:
        remedy = 'give that of each side, such as ("uncalibrated", "calibrated")'
        raise InputError("must be two names", where="conditions", value=repr(conditions), remedy=remedy)
    first, second = (as_text(condition, where="conditions") for condition in conditions)
    return first, second


def _alone(side: Campaign | pd.DataFrame) -> FlagError:
    return FlagError(
        "one campaign has nothing to be compared with",
        value=side.path if isinstance(side, Campaign) else "a table of errors",
        remedy="give a second campaign, or two conditions with --conditions",
    )


def _with_notes(
    compared: Comparison,
    a: Campaign | pd.DataFrame,
    b: Campaign | pd.DataFrame | None,
    *,
    is_itself: bool,
    across_vehicles: bool,
) -> Comparison:
    if not isinstance(a, Campaign) or not isinstance(b, Campaign | None):
        return compared
    known = comparability(a, b, across_vehicles=across_vehicles)
    same = [_SAME_CAMPAIGN] if is_itself else []
    return replace(compared, cautions=known.sentences, remarks=(*compared.remarks, *same))


def _names(
    a: Campaign | pd.DataFrame, b: Campaign | pd.DataFrame | None, conditions: tuple[str, str] | None
) -> tuple[str, str]:
    if b is None and conditions is not None:
        return conditions
    first, second = (str(side.path) if isinstance(side, Campaign) else letter for side, letter in ((a, "A"), (b, "B")))
    return (first, second) if conditions is None else (f"{first} ({conditions[0]})", f"{second} ({conditions[1]})")
