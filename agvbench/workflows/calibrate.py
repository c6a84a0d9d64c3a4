"""What ``agvbench calibrate`` does: measure the calibration runs, fit both ways, print, and write the vehicle."""

from __future__ import annotations

import math
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from agvbench.calibration import Calibration, MapFit, calibrate
from agvbench.campaign import Campaign
from agvbench.errors import FitError
from agvbench.workflows.firmware_header import write_firmware_header
from agvbench.workflows.writing import write_file

_EXPLAINS = 0.5
_CAPTION = (
    "● is in the vehicle model. n commands measured, out left out of the fit. R² and residual (standard deviation): "
    "over the points fitted; rms: over all points; predicted: each command but the outermost, from a fit without it."
)


def run_calibrate(
    directory: str,
    *,
    maps: str = "default",
    session: str | None = None,
    out: str | None = None,
    firmware: str | None = None,
) -> None:
    """Calibrate from the campaign in `directory`, print every fit; write the model to `out`, its hash to `firmware`.

    Raises
    ------
    CampaignError, FitError, VehicleError
        If the campaign cannot be read or does not determine the maps.
    FileError
        If `out` or `firmware` cannot be written.
    """
    errors = Console(stderr=True)
    with errors.status("measuring runs and fitting maps") if errors.is_terminal else _Silence():
        calibration = calibrate(Campaign.open(directory), maps=maps, session=session)
    console = Console()
    console.print(fits_table(calibration))
    for word in [*refused(calibration), *calibration.warnings, *unexplained(calibration)]:
        console.print(f"  {word}", highlight=False, markup=False, soft_wrap=True)
    if out is not None:
        save(calibration, Path(out))
        console.print(f"{out}: calibration {calibration.model.calibration_hash}", soft_wrap=True)
    if firmware is not None:
        write_firmware_header(calibration.model, Path(firmware))
        console.print(f"{firmware}: calibration {calibration.model.calibration_hash}", soft_wrap=True)
    if out is None and firmware is None:
        console.print("nothing written; --out vehicle.toml writes the vehicle model with the maps marked ●")


def save(calibration: Calibration, path: Path) -> None:
    """Write the calibrated vehicle.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_file("--out", path, calibration.model.save)


def fits_table(calibration: Calibration) -> Table:
    """Return all fits below one another; the one in the vehicle model is marked."""
    table = Table(
        title=f"static maps of {calibration.model.name}, from {calibration.model.provenance['method']}",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1),
        collapse_padding=True,
        show_edge=False,
        caption=_CAPTION,
        caption_justify="left",
    )
    table.add_column("")
    table.add_column("fit", no_wrap=True)
    for heading in ("n", "out", "R²", "residual", "rms", "predicted"):
        table.add_column(heading, justify="right", no_wrap=True)
    for role, fits in calibration.fits.items():
        unit, scale, digits = ("mm/s", 1e3, 1) if role == "drive" else ("°", math.degrees(1.0), 3)
        table.add_row("", f"{role}, {unit}" if fits else f"{role}: fixed", style="bold")
        for name, fit in fits.items():
            mark = "●" if name == calibration.chosen[role] else ""
            table.add_row(mark, _short(name), *_numbers(fit, scale, digits))
        table.add_section()
    return table


def _short(name: str) -> str:
    return name.replace("_with_saturation", "").replace("_", " ")


def refused(calibration: Calibration) -> list[str]:
    """Return a sentence for each kind of map that could not be fitted."""
    return [
        f"{role}: no {name.replace('_', ' ')}: {fit}"
        for role, fits in calibration.fits.items()
        for name, fit in fits.items()
        if isinstance(fit, FitError)
    ]


def unexplained(calibration: Calibration) -> list[str]:
    """Return a warning for each chosen map that explains less than half of what was measured."""
    return [
        f"WARNING: {role}: the map explains {100 * max(0.0, fit.r_squared):.0f} % of what was measured; drive it over"
        " its whole range before you believe it"
        for role, fits in calibration.fits.items()
        if isinstance(fit := fits.get(calibration.chosen.get(role, "")), MapFit) and fit.r_squared < _EXPLAINS
    ]


def _numbers(fit: MapFit | FitError, scale: float, digits: int) -> list[str]:
    if isinstance(fit, FitError):
        return ["–"] * 6
    spread = [fit.residual_sd, fit.rms_all, fit.cross_validated_rms]
    told = ["–" if math.isnan(value) else f"{scale * value:.{digits}f}" for value in spread]
    return [str(len(fit.points)), str(len(fit.left_out) or "–"), f"{fit.r_squared:.4f}", *told]


class _Silence:
    """A context in which nothing is shown."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None
