"""``agvbench compare`` and `agvbench.compare`: two campaigns, or two conditions of one, against each other."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.names import as_text
from agvbench.errors import FlagError, InputError
from agvbench.statistics import Comparison, ComparisonVerdict, compare_errors
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.comparison_summary import comparison_to_json
from agvbench.statistics.differences import ALPHA
from agvbench.statistics.intervals import RESAMPLES
from agvbench.statistics.quantities import END_POSE, Quantity
from agvbench.statistics.run_errors import as_errors
from agvbench.workflows.comparability import NOTHING_KNOWN, Comparability, comparability, is_same_campaign
from agvbench.workflows.output_files import write_file

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
    errors_a = as_errors(one, where="a")
    compared = compare_errors(
        errors_a,
        errors_a if other is None else as_errors(other, where="b"),
        margin_mm=margin_mm,
        margin_deg=margin_deg,
        conditions=pair,
        same_campaign=same_campaign or other is None,
        deciding=deciding,
        names=names or _names(one, other, pair),
        alpha=alpha,
        resamples=resamples,
        seed=seed,
    )
    return _with_notes(compared, one, other, across_vehicles=across_vehicles)


def _side(side: Comparable, where: str) -> Campaign | pd.DataFrame:
    if isinstance(side, Campaign | str | PathLike):
        return as_campaign(side)
    return as_errors(side, where=where)


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
    compared: Comparison, a: Campaign | pd.DataFrame, b: Campaign | pd.DataFrame | None, *, across_vehicles: bool
) -> Comparison:
    if not isinstance(a, Campaign) or not isinstance(b, Campaign | None):
        return compared
    known = comparability(a, b, across_vehicles=across_vehicles)
    same = [_SAME_CAMPAIGN] if b is not None and is_same_campaign(a, b) else []
    return replace(compared, cautions=known.sentences, remarks=(*compared.remarks, *same))


def _names(
    a: Campaign | pd.DataFrame, b: Campaign | pd.DataFrame | None, conditions: tuple[str, str] | None
) -> tuple[str, str]:
    if b is None and conditions is not None:
        return conditions
    first, second = (str(side.path) if isinstance(side, Campaign) else letter for side, letter in ((a, "A"), (b, "B")))
    return (first, second) if conditions is None else (f"{first} ({conditions[0]})", f"{second} ({conditions[1]})")


def exit_code(comparison: Comparison, fail_on: str, known: Comparability = NOTHING_KNOWN) -> int:
    """Return 0 (no regression), 1 (regression, or any difference with ``any``), 2 (could not compare) or 3.

    3, inconclusive: the campaigns are not comparable, or one is incomplete and no regression was found. With ``never``
    every comparison that was possible gives 0.
    """
    if not comparison.could_compare:
        return 2
    if fail_on == "never":
        return 0
    if known.incomparable:
        return 3
    bad = {"regression": [ComparisonVerdict.WORSE], "any": [ComparisonVerdict.WORSE, ComparisonVerdict.BETTER]}[fail_on]
    if any(comparison.of(verdict) for verdict in bad):
        return 1
    return 3 if known.incomplete else 0


def write_json(comparison: Comparison, path: str | Path, known: Comparability = NOTHING_KNOWN) -> None:
    """Write `comparison` as JSON (schema 1), with what was `known` before it.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    content = comparison_to_json(comparison) | {
        "complete": not known.incomplete,
        "cautions": list(known.sentences),
        "calibrations": list(known.calibrations),
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    write_file("--json", Path(path), lambda file: file.write_text(f"{text}\n", encoding="utf-8"))
