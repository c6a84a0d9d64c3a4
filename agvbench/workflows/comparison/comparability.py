"""Whether two campaigns are comparable: what is missing from them, and what differs besides the errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.completeness import Completeness
from agvbench.errors import AgvbenchError, NotComparableError
from agvbench.running.configuration.provenance import INPUTS_TABLE
from agvbench.running.configuration.settings import BenchSettings
from agvbench.simulator import seed_samples_vehicle
from agvbench.vehicle.channels import Channels
from agvbench.workflows.comparison.sequential_record import SequentialRecord, stopped_in_words

_VEHICLE = ("agv", "plant", "plant_option")
_CAMERA = ("mocap", "camera")
HASH_DIGITS = 12
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


def comparability(a: Campaign, b: Campaign | None, *, across_vehicles: bool = False) -> Comparability:
    """Return what to know before campaign `b` is compared with `a`, or two conditions of `a` (`b` None).

    With ``across_vehicles`` vehicles of different units are compared on purpose.

    Raises
    ------
    CampaignError
        If a table cannot be read.
    """
    sides = [side for side in (a, b) if side is not None]
    incomplete = tuple(_incomplete(side) for side in sides if (done := Completeness.of(side)) and not done.is_complete)
    if b is None or is_same_campaign(a, b):
        return Comparability(incomplete)
    units, *notes = (tuple(find(a, b)) for find in (_units, *_NOTES))
    qualified = tuple(sentence for found in notes for sentence in found)
    hashes = tuple(calibration_hash(side.path) for side in sides)
    if across_vehicles:
        return Comparability(incomplete, (), (*units, *qualified), hashes)
    return Comparability(incomplete, units, qualified, hashes)


def require_comparable(a: Campaign, channels: Channels) -> None:
    """Check that a campaign that will be driven with `channels` can be compared with `a`.

    Raises
    ------
    NotComparableError
        If `a` is incomplete, or its vehicle takes commands in other units.
    CampaignError
        If a table of `a` cannot be read.
    """
    if (done := Completeness.of(a)) is not None and not done.is_complete:
        raise NotComparableError(_incomplete(a))
    for sentence in _differing_units(a.header.channels, channels):
        raise NotComparableError(sentence.removesuffix("."))


def is_same_campaign(a: Campaign, b: Campaign) -> bool:
    """Return whether both were read from one directory."""
    return a.path.resolve() == b.path.resolve()


def _incomplete(side: Campaign) -> str:
    return f"{side.path} is incomplete: {Completeness.of(side)}; agvbench bench --resume --out {side.path} drives them"


def _units(a: Campaign, b: Campaign) -> Iterator[str]:
    yield from _differing_units(a.header.channels, b.header.channels)


def _differing_units(a: Channels, b: Channels) -> Iterator[str]:
    one, other = _units_text(a), _units_text(b)
    if one != other:
        yield (
            f"The vehicles take commands in different units ({one} and {other}): "
            "they are not one kind of vehicle (compared on purpose: --across-vehicles)."
        )


def _vehicles(a: Campaign, b: Campaign) -> Iterator[str]:
    differing = [f"{name} {one} and {other}" for name, one, other in _vehicle_facts(a, b) if one != other]
    if differing:
        yield f"The vehicles differ: {', '.join(differing)}."


def _vehicle_facts(a: Campaign, b: Campaign) -> Iterator[tuple[str, str, str]]:
    one, other = a.header, b.header
    yield "name", one.vehicle_name, other.vehicle_name
    for axle in ("front_axle_m", "rear_axle_m"):
        yield axle, f"{getattr(one, axle):g} m", f"{getattr(other, axle):g} m"
    if _units_text(one.channels) == _units_text(other.channels):
        yield _channel_facts(one.channels, other.channels)
    yield "driven axle", one.driven, other.driven
    yield "kinematics", one.kinematics, other.kinematics
    yield from _options(a, b, _VEHICLE)


def _channel_facts(one: Channels, other: Channels) -> tuple[str, str, str]:
    if (a := one.common) and (b := other.common):
        return "neutral", f"{a.neutral:g} {a.unit}", f"{b.neutral:g} {b.unit}"
    return "channels", f"({one})", f"({other})"


def _units_text(channels: Channels) -> str:
    """Return the unit of all channels, or that of each."""
    if channels.table_unit != "channels":
        return channels.table_unit
    return f"drive {channels.drive.unit}, front {channels.front.unit}, rear {channels.rear.unit}"


def _sampled_vehicles(a: Campaign, b: Campaign) -> Iterator[str]:
    one, other = _settings(a), _settings(b)
    if one is None or other is None or one.plant != other.plant or one.seed == other.seed:
        return
    if seed_samples_vehicle(one.plant):
        yield (
            f"The simulated vehicles differ: {one.plant} samples another vehicle for each seed "
            f"(--seed {one.seed} and {other.seed}). To compare two evenings of one vehicle, drive both with one seed."
        )


def _cameras(a: Campaign, b: Campaign) -> Iterator[str]:
    rates = ("rate", f"{a.header.mocap_rate_hz:g} Hz", f"{b.header.mocap_rate_hz:g} Hz")
    facts = [rates, *_options(a, b, _CAMERA)]
    differing = [f"{name} {first} and {second}" for name, first, second in facts if first != second]
    if differing:
        yield f"The cameras differ: {', '.join(differing)}."


def _options(a: Campaign, b: Campaign, names: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Yield options with their values on both sides, if both campaigns have recorded theirs."""
    if (one := _settings(a)) and (other := _settings(b)):
        for name in names:
            yield f"--{name.replace('_', '-')}", getattr(one, name) or "none", getattr(other, name) or "none"


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
    hashes = [calibration_hash(side.path) for side in (a, b)]
    calibrated = any(set(side.runs["condition"]) - {"uncalibrated", ""} for side in (a, b))
    if all(hashes) and hashes[0] != hashes[1] and calibrated:
        yield (
            f"The calibrations differ ({hashes[0][:HASH_DIGITS]} and {hashes[1][:HASH_DIGITS]}): this is part of every "
            "difference but the uncalibrated ones. To compare firmware or vehicles alone, drive both with one "
            "calibration (bench --calibration FILE)."
        )


def _labels(a: Campaign, b: Campaign) -> Iterator[str]:
    one, other = a.header.labels, b.header.labels
    names = [name for name in dict.fromkeys((*one, *other)) if one.get(name) != other.get(name)]
    if names:
        words = (f"{name} {one.get(name, 'none')} and {other.get(name, 'none')}" for name in names)
        yield f"The labels differ: {', '.join(words)}."


def _sequentially_stopped(a: Campaign, b: Campaign) -> Iterator[str]:
    for side in (a, b):
        if (record := SequentialRecord.load(side.path)) is not None and record.analyses:
            yield stopped_in_words(side.path, record)


_NOTES = (_vehicles, _sampled_vehicles, _cameras, _trajectories, _calibrations, _labels, _sequentially_stopped)


def calibration_hash(campaign: Path) -> str:
    """Return the hash of the vehicle file in a campaign directory; "" where there is none that can be read."""
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
