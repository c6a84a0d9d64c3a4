"""``agvbench compare``: two campaigns, or two conditions, against each other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.errors import FlagError
from agvbench.statistics import Comparison, Verdict, compare, pose_errors
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.comparison_summary import comparison_to_json
from agvbench.statistics.quantities import END_POSE, QUANTITIES
from agvbench.workflows.comparability import NOTHING_KNOWN, Comparability
from agvbench.workflows.writing import write_file

_SAME_CAMPAIGN = "both sides are the same campaign: no difference can be found"


def compare_campaigns(
    a: str | Path,
    b: str | Path | None = None,
    *,
    conditions: tuple[str, str] | None = None,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    distance_decides: bool = False,
) -> Comparison:
    """Compare campaign `b` with campaign `a`, or two conditions of `a` with each other.

    With ``distance_decides`` |Δs| counts as end position error and heading error do, instead of being a note.

    Raises
    ------
    AgvbenchError
        If a campaign cannot be read, there is nothing to compare, or a margin cannot be used.
    """
    if b is None and conditions is None:
        raise FlagError(
            "one campaign has nothing to be compared with",
            value=a,
            remedy="give a second campaign, or two conditions with --conditions",
        )
    errors_a = pose_errors(Campaign.open(a))
    errors_b = errors_a if b is None else pose_errors(Campaign.open(b))
    comparison = compare(
        errors_a,
        errors_b,
        margin_mm=margin_mm,
        margin_deg=margin_deg,
        conditions=conditions,
        same_campaign=b is None,
        deciding=QUANTITIES if distance_decides else END_POSE,
        names=_names(Path(a), None if b is None else Path(b), conditions),
    )
    if b is None or Path(a).resolve() != Path(b).resolve():
        return comparison
    return replace(comparison, notes=(*comparison.notes, _SAME_CAMPAIGN))


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
    bad = {"regression": [Verdict.WORSE], "any": [Verdict.WORSE, Verdict.BETTER]}[fail_on]
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


def _names(a: Path, b: Path | None, conditions: tuple[str, str] | None) -> tuple[str, str]:
    sides = (a, a if b is None else b)
    if conditions is None:
        return str(sides[0]), str(sides[1])
    if b is None:
        return conditions
    return f"{sides[0]} ({conditions[0]})", f"{sides[1]} ({conditions[1]})"
