"""``agvbench calibrate``: measure the calibration runs, fit both ways, write vehicle and firmware header."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from agvbench.campaign import Campaign
from agvbench.errors import AgvbenchError
from agvbench.model import VehicleModel
from agvbench.types import Floats
from agvbench.vehicle.channels import channels_of, quantity_of
from agvbench.vehicle.geometry import Geometry
from agvbench.workflows.output_files import write_file

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.calibration import Calibration


def calibrated(directory: str, *, maps: str = "default", session: str | None = None) -> Calibration:
    """Return the calibration from the campaign in `directory`; a terminal shows that something goes on.

    The model keeps the priors of the campaign's ``vehicle.toml``.

    Raises
    ------
    CampaignError, FitError, VehicleError
        If the campaign cannot be read or does not determine the maps.
    """
    from agvbench.calibration import calibrate  # only here: reports read curves, and numba takes seconds to import

    errors, campaign = Console(stderr=True), Campaign.open(directory)
    with errors.status("measuring runs and fitting maps") if errors.is_terminal else nullcontext():
        found = calibrate(campaign, maps=maps, session=session)
    return replace(found, model=_with_priors_of(found.model, campaign.path / VEHICLE))


def save(calibration: Calibration, path: Path) -> None:
    """Write the calibrated vehicle, with its priors or else those of the vehicle file that it replaces.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_file("--out", path, _with_priors_of(calibration.model, path).save)


def _with_priors_of(model: VehicleModel, path: Path) -> VehicleModel:
    """Return `model` with the priors of the vehicle file `path`, if it has none; a file that is no vehicle has none."""
    if model.priors or not path.is_file():
        return model
    try:
        return replace(model, priors=VehicleModel.load(path).priors)
    except AgvbenchError:
        return model


def firmware_header(model: VehicleModel) -> str:
    """Return a C header with the calibration hash of `model`, for ``make CALIBRATION=FILE.h`` in ``firmware/``."""
    name = "".join(letter if letter.isalnum() or letter in " _-" else "_" for letter in model.name)
    return (
        f"/* Calibration of {name}; made by `agvbench calibrate --firmware`. */\n"
        f'#define CALIBRATION_HASH "{model.calibration_hash}"\n'
    )


def write_firmware_header(model: VehicleModel, path: Path) -> None:
    """Write the header of `model`.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = firmware_header(model)
    write_file("--firmware", path, lambda header: header.write_text(text, encoding="ascii", errors="replace"))


TABLE, VEHICLE = "calibration", "vehicle.toml"
_REQUIRED = ("axle", "command", "value")
_TRUE = {"true", "1", "1.0", "yes"}
_CURVE_POINTS = 240


@dataclass(frozen=True)
class Curve:
    """One channel: measured points, arrays of shape (n,), and the fitted map sampled, shape (m,) (empty: no model)."""

    axle: str
    channel: str
    unit: str
    command: Floats
    value: Floats
    stderr: Floats
    left_out: np.ndarray[tuple[int], np.dtype[np.bool_]]
    fitted: Floats
    map_command: Floats
    map_value: Floats


@dataclass(frozen=True)
class CalibrationCurves:
    """All curves, what the maps are, and a sentence where something is absent."""

    curves: list[Curve] = field(default_factory=list)
    kinds: dict[str, str] = field(default_factory=dict)
    why_absent: str = ""
    model_name: str = ""
    model_hash: str = ""


def read_calibration_curves(campaign: Campaign) -> CalibrationCurves:
    """Return the calibration curves of `campaign`, as far as its directory holds them; their absence is no error.

    The measurements are the table ``calibration`` (``axle`` front, rear or drive; ``command`` in vehicle units;
    ``value`` in deg, rad/s or m/s; optional ``stderr``, ``run_id``, ``left_out``), the maps are those of
    ``vehicle.toml``.
    """
    if not any((campaign.path / f"{TABLE}{suffix}").exists() for suffix in (".parquet", ".csv")):
        return CalibrationCurves(why_absent="The campaign holds no calibration measurements (table calibration).")
    try:
        table = campaign.table(TABLE)
    except AgvbenchError as error:
        return CalibrationCurves(why_absent=f"The calibration measurements cannot be read: {error}.")
    missing = [name for name in _REQUIRED if name not in table.columns]
    if missing:
        return CalibrationCurves(why_absent=f"The calibration measurements lack the column {missing[0]}.")
    model, why = _model(campaign)
    geometry = campaign.header.geometry
    curves = [curve for axle in channels_of(geometry) if (curve := _curve(table, axle, geometry, model)) is not None]
    kinds = {str(c.axle): getattr(model, c.axle).kind.replace("_", " ") for c in curves} if model else {}
    if not curves:
        why = "The calibration measurements name no axle of front, rear and drive."
    name, hashed = (model.name, model.calibration_hash) if model else ("", "")
    return CalibrationCurves(curves, kinds, why, name, hashed)


def _model(campaign: Campaign) -> tuple[VehicleModel | None, str]:
    from agvbench.model import VehicleModel

    path = campaign.path / VEHICLE
    if not path.exists():
        return None, f"The campaign holds no {VEHICLE}, so that no fitted curve is drawn."
    try:
        return VehicleModel.load(path), ""
    except AgvbenchError as error:
        return None, f"No fitted curve is drawn: {error}."


def _curve(table: pd.DataFrame, axle: str, geometry: Geometry, model: VehicleModel | None) -> Curve | None:
    rows = table[table["axle"].astype(str) == axle]
    command, value = _numbers(rows, "command"), _numbers(rows, "value")
    usable = np.isfinite(command) & np.isfinite(value)
    if not usable.any():
        return None
    left_out = np.array([str(v).lower() in _TRUE for v in rows.get("left_out", [False] * len(rows))], dtype=np.bool_)
    none, quantity = np.empty(0), quantity_of(axle, geometry)
    fitted, map_command, map_value = none, none, none
    if model is not None:
        scale = quantity.scale
        static_map = getattr(model, axle)
        low, high = float(command[usable].min()), float(command[usable].max())
        map_command = np.linspace(low, high, _CURVE_POINTS)
        fitted, map_value = scale * static_map(command[usable]), scale * static_map(map_command)
    return Curve(
        axle,
        quantity.channel,
        quantity.word,
        command[usable],
        value[usable],
        _numbers(rows, "stderr")[usable],
        left_out[usable],
        fitted,
        map_command,
        map_value,
    )


def _numbers(rows: pd.DataFrame, column: str) -> Floats:
    import pandas as pd

    if column not in rows.columns:
        return np.full(len(rows), np.nan)
    return np.asarray(pd.to_numeric(rows[column], errors="coerce").to_numpy(dtype=float, na_value=np.nan))
