"""A calibration on the console: every fit, and what to be careful with."""

from __future__ import annotations

import math

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agvbench.calibration import Calibration, MapFit
from agvbench.errors import FitError
from agvbench.vehicle.channels import channels_of, quantity_of

_EXPLAINS = 0.5
_CAPTION = (
    "● is in the vehicle model. n commands measured, out left out of the fit. R² and residual (standard deviation): "
    "over the points fitted; rms: over all points; predicted: each command but the outermost, from a fit without it."
)


def print_calibration(calibration: Calibration, console: Console) -> None:
    """Print every fit, and why others were refused."""
    console.print(_fits_table(calibration))
    for word in [*_refused(calibration), *calibration.warnings, *_unexplained(calibration)]:
        console.print(f"  {word}", highlight=False, markup=False, soft_wrap=True)


def _fits_table(calibration: Calibration) -> Table:
    """Return all fits below one another; the one in the vehicle model is marked."""
    table = Table(
        title=Text(f"static maps of {calibration.model.name}, from {calibration.model.provenance['method']}"),
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
    geometry = calibration.model.geometry
    for role in channels_of(geometry):
        fits, quantity = calibration.fits[role], quantity_of(role, geometry)
        unit, scale, digits = ("mm/s", 1e3, 1) if role == "drive" else (quantity.unit, quantity.scale, 3)
        name = quantity.channel if geometry.is_differential else role
        table.add_row("", f"{name}, {unit}" if fits else f"{name}: fixed", style="bold")
        for name, fit in fits.items():
            mark = "●" if name == calibration.chosen[role] else ""
            table.add_row(mark, _short(name), *_numbers(fit, scale, digits))
        table.add_section()
    return table


def _short(name: str) -> str:
    return name.replace("_with_saturation", "").replace("_", " ")


def _refused(calibration: Calibration) -> list[str]:
    """Return a sentence for each kind of map that could not be fitted."""
    return [
        f"{role}: no {name.replace('_', ' ')}: {fit}"
        for role, fits in calibration.fits.items()
        for name, fit in fits.items()
        if isinstance(fit, FitError)
    ]


def _unexplained(calibration: Calibration) -> list[str]:
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
    shown = ["–" if math.isnan(value) else f"{scale * value:.{digits}f}" for value in spread]
    return [str(len(fit.points)), str(len(fit.left_out) or "–"), f"{fit.r_squared:.4f}", *shown]
