"""What to know before two campaigns are compared: runs that are missing, and conditions in which they differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.completeness import Completeness
from agvbench.errors import AgvbenchError
from agvbench.running.configuration.provenance import INPUTS_TABLE
from agvbench.running.configuration.settings import BenchSettings

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
        """All sentences, the gravest first."""
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
