"""``agvbench compare``: two campaigns or conditions against each other, and whether they are comparable."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.completeness import Completeness
from agvbench.errors import AgvbenchError, FlagError
from agvbench.running.configuration.provenance import INPUTS_TABLE
from agvbench.running.configuration.settings import BenchSettings
from agvbench.statistics import Comparison, ComparisonVerdict, compare, pose_errors
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.comparison_summary import comparison_to_json
from agvbench.statistics.quantities import END_POSE, QUANTITIES
from agvbench.workflows.output_files import write_file

_GEOMETRY = {"front_axle_m": "m", "rear_axle_m": "m"}
_CAMERA = ("mocap", "camera")
_DIGITS = 12
"""Of a hash, as versions are known by theirs; the JSON has them whole."""


@dataclass(frozen=True)
class Comparability:
    """``incomplete`` and ``incomparable`` forbid a conclusion, ``notes`` qualify it; sentences of one line each.

    ``calibrations`` are the hashes of both sides' vehicle files, "" where there is none.
    """

    incomplete: tuple[str, ...] = ()
    incomparable: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    calibrations: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """All sentences, the most severe first."""
        return (*self.incomparable, *self.incomplete, *self.notes)


NOTHING_KNOWN = Comparability()


def comparability(a: str | Path, b: str | Path | None, *, across_vehicles: bool = False) -> Comparability:
    """Return what to know before campaign `b` is compared with `a`, or two conditions of `a` (`b` None).

    With ``across_vehicles`` vehicles of different units are compared on purpose.

    Raises
    ------
    CampaignError
        If a table cannot be read.
    """
    sides = [Campaign.open(side) for side in (a, b) if side is not None]
    incomplete = tuple(_incomplete(side) for side in sides if (done := Completeness.of(side)) and not done.is_complete)
    if b is None or Path(a).resolve() == Path(b).resolve():
        return Comparability(incomplete)
    units, *notes = (tuple(find(*sides)) for find in (_units, _vehicles, _cameras, _trajectories, _calibrations))
    qualified = tuple(sentence for found in notes for sentence in found)
    hashes = tuple(_calibration_hash(side.path) for side in sides)
    if across_vehicles:
        return Comparability(incomplete, (), (*units, *qualified), hashes)
    return Comparability(incomplete, units, qualified, hashes)


def _incomplete(side: Campaign) -> str:
    return f"{side.path} is incomplete: {Completeness.of(side)}; agvbench bench --resume --out {side.path} drives them"


def _units(a: Campaign, b: Campaign) -> Iterator[str]:
    if a.header.command_unit != b.header.command_unit:
        yield (
            f"The vehicles take commands in different units ({a.header.command_unit} and {b.header.command_unit}): "
            "they are not one kind of vehicle (compared on purpose: --across-vehicles)."
        )


def _vehicles(a: Campaign, b: Campaign) -> Iterator[str]:
    found = [(name, getattr(a.header, name), getattr(b.header, name), unit) for name, unit in _GEOMETRY.items()]
    if a.header.command_unit == b.header.command_unit:
        found.append(("neutral", a.header.neutral, b.header.neutral, a.header.command_unit))
    differing = [f"{name} {one:g} and {other:g} {unit}" for name, one, other, unit in found if one != other]
    if a.header.driven != b.header.driven:
        differing.append(f"driven axle {a.header.driven} and {b.header.driven}")
    if differing:
        yield f"The vehicles differ: {', '.join(differing)}."


def _cameras(a: Campaign, b: Campaign) -> Iterator[str]:
    found = [("rate", f"{a.header.mocap_rate_hz:g} Hz", f"{b.header.mocap_rate_hz:g} Hz")]
    if (one := _settings(a)) and (other := _settings(b)):
        found += [(f"--{name}", getattr(one, name) or "none", getattr(other, name) or "none") for name in _CAMERA]
    differing = [f"{name} {first} and {second}" for name, first, second in found if first != second]
    if differing:
        yield f"The cameras differ: {', '.join(differing)}."


def _trajectories(a: Campaign, b: Campaign) -> Iterator[str]:
    one, other = _inputs(a), _inputs(b)
    shared = [name for name in one if name.startswith("trajectory ") and name in other]
    differing = [name.removeprefix("trajectory ") for name in shared if one[name] != other[name]]
    if differing:
        yield f"The files of trajectories differ: {', '.join(differing)}."
    modes = [settings.steering for side in (a, b) if (settings := _settings(side))]
    if len(set(modes)) > 1:
        yield f"The trajectories were steered differently: --steering {modes[0] or 'none'} and {modes[1] or 'none'}."


def _calibrations(a: Campaign, b: Campaign) -> Iterator[str]:
    hashes = [_calibration_hash(side.path) for side in (a, b)]
    calibrated = any(set(side.runs["condition"]) - {"uncalibrated", ""} for side in (a, b))
    if all(hashes) and hashes[0] != hashes[1] and calibrated:
        yield (
            f"The calibrations differ ({hashes[0][:_DIGITS]} and {hashes[1][:_DIGITS]}): this is part of every "
            "difference but the uncalibrated ones. To compare firmware or vehicles alone, drive both with one "
            "calibration (bench --calibration FILE)."
        )


def _calibration_hash(campaign: Path) -> str:
    from agvbench.model import VehicleModel

    try:
        return VehicleModel.load(campaign / "vehicle.toml").calibration_hash
    except AgvbenchError:
        return ""


def _settings(side: Campaign) -> BenchSettings | None:
    try:
        return BenchSettings.load(side.path)
    except AgvbenchError:
        return None


def _inputs(side: Campaign) -> dict[str, str]:
    if not side.has_table(INPUTS_TABLE):
        return {}
    table = side.table(INPUTS_TABLE)
    return dict(zip(table["input"], table["sha256"], strict=True))


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


def _names(a: Path, b: Path | None, conditions: tuple[str, str] | None) -> tuple[str, str]:
    sides = (a, a if b is None else b)
    if conditions is None:
        return str(sides[0]), str(sides[1])
    if b is None:
        return conditions
    return f"{sides[0]} ({conditions[0]})", f"{sides[1]} ({conditions[1]})"
