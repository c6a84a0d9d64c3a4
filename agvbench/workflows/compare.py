"""``agvbench compare``: two campaigns, or two conditions, against each other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.errors import AgvbenchError, FileError, FlagError
from agvbench.statistics import Comparison, Verdict, compare, pose_errors
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.comparison_json import comparison_to_json


def compare_campaigns(
    a: str | Path,
    b: str | Path | None = None,
    *,
    conditions: tuple[str, str] | None = None,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
) -> Comparison:
    """Compare campaign `b` with campaign `a`, or two conditions of `a` with each other.

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
        names=_names(Path(a), None if b is None else Path(b), conditions),
    )
    notes = comparison.notes if b is None else (*comparison.notes, *_notes(Path(a), Path(b), comparison))
    return replace(comparison, notes=notes)


def exit_code(comparison: Comparison, fail_on: str) -> int:
    """Return 0 (no regression), 1 (regression, or any difference with ``any``) or 2 (could not compare)."""
    if not comparison.could_compare:
        return 2
    bad = {"regression": [Verdict.WORSE], "any": [Verdict.WORSE, Verdict.BETTER], "never": []}[fail_on]
    return int(any(comparison.of(verdict) for verdict in bad))


def write_json(comparison: Comparison, path: str | Path) -> None:
    """Write `comparison` as JSON (schema 1).

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = json.dumps(comparison_to_json(comparison), indent=2, ensure_ascii=False, allow_nan=False)
    try:
        Path(path).write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=path, remedy="choose another file") from None


def _notes(a: Path, b: Path, comparison: Comparison) -> tuple[str, ...]:
    """Return what to know before believing a comparison of two campaigns."""
    if a.resolve() == b.resolve():
        return ("both sides are the same campaign: no difference can be found",)
    return _calibration_note(a, b, comparison)


def _calibration_note(a: Path, b: Path, comparison: Comparison) -> tuple[str, ...]:
    """Return a warning where both sides were calibrated, each for itself."""
    hashes = [_calibration_hash(side) for side in (a, b)]
    uncalibrated = all(d.condition in {"uncalibrated", "all"} for d in comparison.differences)
    if not all(hashes) or hashes[0] == hashes[1] or uncalibrated:
        return ()
    said = (
        f"The sides were calibrated separately ({hashes[0]} and {hashes[1]}): what one calibration measured better or "
        "worse than the other is part of every difference but the uncalibrated ones. To compare firmware or vehicles "
        "alone, drive both with one calibration (bench --calibration FILE)."
    )
    return (said,)


def _calibration_hash(campaign: Path) -> str:
    from agvbench.model import VehicleModel

    try:
        return VehicleModel.load(campaign / "vehicle.toml").calibration_hash
    except AgvbenchError:
        return ""


def _names(a: Path, b: Path | None, conditions: tuple[str, str] | None) -> tuple[str, str]:
    sides = (a, a if b is None else b)
    if conditions is None:
        return str(sides[0]), str(sides[1])
    if b is None:
        return conditions
    return f"{sides[0]} ({conditions[0]})", f"{sides[1]} ({conditions[1]})"
