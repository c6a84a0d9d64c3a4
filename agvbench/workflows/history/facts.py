"""What campaigns record besides errors (firmware, calibration, program, vehicle, options, files), and what changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.errors import AgvbenchError
from agvbench.running.configuration.provenance import INPUTS_TABLE, recorded_rows
from agvbench.running.configuration.settings import BenchSettings
from agvbench.workflows.comparison.comparability import HASH_DIGITS, calibration_hash

_OF_PROGRAM = ("agvbench", "git_revision", "host")
_OPTIONS = (
    *("agv", "mocap", "camera", "plant", "plant_option", "maps"),
    *("steering", "order", "place", "workspace", "exchange"),
)
Facts = Mapping[str, str]
LABEL = "label "


def facts_of(campaign: Path, firmware: str) -> Facts:
    """Return what a campaign records about itself, by name; what it does not record, or cannot be read, is left out."""
    found = {"firmware": firmware, "calibration": calibration_hash(campaign)[:HASH_DIGITS]}
    for read in (_program, _header, _options, _files):
        with suppress(AgvbenchError, OSError, KeyError):
            found |= read(campaign)
    return {name: value for name, value in found.items() if value}


def changed(before: Facts, after: Facts) -> Iterator[str]:
    """Yield a phrase for each fact that both campaigns record and that differs.

    >>> list(changed({"firmware": "2.0", "host": "lab"}, {"firmware": "2.1"}))
    ['firmware 2.0 → 2.1']
    """
    for name, was, value in differences(before, after):
        yield f"{name} {was} → {value}"


def differences(before: Facts, after: Facts) -> Iterator[tuple[str, str, str]]:
    """Yield name and both values of each fact that both campaigns record and that differs.

    A label that only one of them has differs, too: it is "" in the other.
    """
    labels = (name for name in before if name.startswith(LABEL) and name not in after)
    for name in (*after, *labels):
        one, other = (side.get(name, "" if name.startswith(LABEL) else None) for side in (before, after))
        if one is not None and other is not None and one != other:
            yield name, one, other


def _program(campaign: Path) -> dict[str, str]:
    facts = {str(row["name"]): str(row["value"]) for row in recorded_rows(campaign, "provenance")}
    return {name: facts[name] for name in _OF_PROGRAM if name in facts}


def _header(campaign: Path) -> dict[str, str]:
    header = CampaignHeader.load(campaign / FILE_NAME)
    left_out = ("schema", "name", "prediction_horizon_s", "prediction_stride_s", "labels", "uncertainty")
    return {f"{LABEL}{name}": value for name, value in header.labels.items()} | {
        name: f"{value:g}" if isinstance(value, float) else str(value)
        for name, value in vars(header).items()
        if name not in left_out
    }


def _options(campaign: Path) -> dict[str, str]:
    settings = BenchSettings.load(campaign)
    return {f"--{name.replace('_', '-')}": str(getattr(settings, name)) or "none" for name in _OPTIONS}


def _files(campaign: Path) -> dict[str, str]:
    """Return the hashes of trajectories, benchmarks and option files; that of the calibration is a fact of its own."""
    hashes = {str(row["input"]): str(row["sha256"]) for row in recorded_rows(campaign, INPUTS_TABLE)}
    return {
        f"file of {name}" if name.startswith("--") else name: digest[:HASH_DIGITS]
        for name, digest in hashes.items()
        if name != "--calibration"
    }
