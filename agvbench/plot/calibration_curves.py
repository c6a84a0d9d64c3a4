"""What calibration measured of one axle or the drive, and the map fitted to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import InputError, OneOf
from agvbench.plot.style import ON_WHITE, Ink, colour, label, require_result
from agvbench.types import Floats
from agvbench.vehicle.channels import channels_of, quantity_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from agvbench.calibration import Calibration

_UNITS = {"us": "µs"}
_MEASURED, _LEFT_OUT = 1, 0
_CURVE_POINTS = 240


def calibration_curve(axes: Axes, calibration: Calibration, axle: Literal["front", "rear", "drive"]) -> Axes:
    """Draw what was measured, with standard errors, and the fitted map; crosses were left out of the fit.

    Parameters
    ----------
    axes
        Where to draw: the command in the vehicle's unit, and the axle angle [°], the yaw rate [rad/s] or the
        speed [m/s].
    calibration
        What `agvbench.calibrate` returned.
    axle
        ``"front"``, ``"rear"`` or ``"drive"``.

    Raises
    ------
    InputError
        If `calibration` is none, there is no such axle, or nothing was measured of it.
    """
    require_result(calibration, "measurements", where="calibration", made_by="agvbench.calibrate")
    table, model = calibration.measurements, calibration.model
    rows = table[table["axle"] == axle]
    if rows.empty:
        raise InputError(
            "nothing was measured", where="axle", value=repr(axle), limit=OneOf(channels_of(model.geometry))
        )
    quantity = quantity_of(axle, model.geometry)
    command, value, stderr = (rows[name].to_numpy(dtype=float) for name in ("command", "value", "stderr"))
    at = np.linspace(command.min(), command.max(), _CURVE_POINTS)
    set_value = f"{quantity.channel} {quantity.name}" if quantity.name == "angle" else quantity.name
    label(
        axes,
        x=f"command [{_UNITS.get(getattr(model.channels, axle).unit, '–')}]",
        y=f"{set_value} [{quantity.unit}]",
        title=calibration.chosen[axle],
    )
    axes.plot(at, quantity.scale * getattr(model, axle)(at), color=ON_WHITE.ink, linewidth=1.2)
    draw_measured(axes, command, value, stderr, rows["left_out"].to_numpy(dtype=np.bool_), ON_WHITE)
    return axes


def draw_measured(
    axes: Axes, command: Floats, value: Floats, stderr: Floats, left_out: NDArray[np.bool_], ink: Ink
) -> None:
    """Draw measured values with their standard errors, all of shape (n,); crosses where they were left out."""
    for chosen, index, shape in ((~left_out, _MEASURED, "o"), (left_out, _LEFT_OUT, "x")):
        errors = np.where(np.isfinite(stderr), stderr, 0.0)[chosen]
        axes.errorbar(
            command[chosen],
            value[chosen],
            yerr=errors,
            fmt=shape,
            markersize=4,
            color=colour(index),
            ecolor=ink.muted,
            elinewidth=0.8,
            markeredgecolor=ink.paper if shape == "o" else colour(index),
            markeredgewidth=0.5 if shape == "o" else 1.2,
        )
