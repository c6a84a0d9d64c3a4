"""The residual of a diagnosis against what it may depend on, before and after."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from agvbench.errors import InputError, OneOf
from agvbench.plot.style import ON_WHITE, Ink, colour, label, marker, require_result
from agvbench.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from agvbench.diagnosis import Diagnosis

BEFORE, AFTER = 0, 1
Feature = Literal["speed", "sideways", "turning"]
FEATURES = {
    "speed": ("residual along the way [%]", 100.0),
    "sideways": ("residual to the left [%]", 100.0),
    "turning": ("residual turn [°/m]", math.degrees(1.0)),
}
COVARIATES = {
    "time_in_run_s": "time in the run [s]",
    "speed_mps": "speed [m/s]",
    "curvature_per_m": "curvature [1/m]",
    "direction": "direction (−1 backward, 1 forward)",
    "campaign_time_h": "time since the session began [h]",
    "x_m": "x [m]",
    "y_m": "y [m]",
    "heading_rad": "heading [rad]",
    "course_rad": "direction of motion [rad]",
}
_BINS, _FEWEST = 16, 8
_FEW_VALUES = 4


def residuals(axes: Axes, diagnosis: Diagnosis, *, feature: Feature = "speed", against: str = "time_in_run_s") -> Axes:
    """Draw the residual of the model before and after, in the vehicle's frame and per metre driven.

    Marks are medians of the steps in a bin of the covariate, lines their quartiles. A residual that does not depend on
    the covariate is a level line.

    Parameters
    ----------
    axes
        Where to draw.
    diagnosis
        What `agvbench.diagnose` returned.
    feature
        ``"speed"``: distance along the way [%]; ``"sideways"``: distance to the left [%]; ``"turning"``: change of
        heading [°/m].
    against
        The covariate, a column of ``diagnosis.residuals``: ``time_in_run_s``, ``speed_mps``, ``curvature_per_m``,
        ``direction``, ``campaign_time_h``, ``x_m``, ``y_m`` or ``heading_rad`` (floor frame).

    Raises
    ------
    InputError
        If `diagnosis` is none or has no residuals, or there is no such feature or covariate.
    """
    require_result(diagnosis, "residuals", where="diagnosis", made_by="agvbench.diagnose")
    for what, given, known in (("feature", feature, FEATURES), ("against", against, COVARIATES)):
        if given not in known:
            raise InputError("cannot be drawn", where=what, value=repr(given), limit=OneOf(known))
    table = diagnosis.residuals
    if table is None or table.empty:
        raise InputError("the diagnosis has no residuals", value=str(diagnosis.verdict), remedy="see diagnosis.why")
    words, scale = FEATURES[feature]
    label(axes, x=COVARIATES[against], y=words)
    before, after = (scale * table[f"{when}_{feature}"].to_numpy(dtype=float) for when in ("before", "after"))
    draw_steps(axes, table[against].to_numpy(dtype=float), before, after, ON_WHITE)
    for name, index in (("before", BEFORE), ("after", AFTER)):
        axes.plot([], [], marker=marker(index), color=colour(index), linestyle="none", label=name)
    axes.legend()
    return axes


def draw_steps(axes: Axes, covariate: Floats, before: Floats, after: Floats, ink: Ink) -> None:
    """Draw both residuals (n,) against a covariate (n,): medians and quartiles of bins."""
    axes.axhline(0.0, color=ink.ink, linewidth=0.8)
    bins = _bins(covariate)
    for index, values in ((BEFORE, before), (AFTER, after)):
        _quartiles(axes, covariate, values, bins, index, ink)
    axes.margins(x=0.05)
    axes.locator_params(nbins=6)


def _bins(covariate: Floats) -> Floats:
    """Return the edges of bins: one for each of few values, else of equal counts."""
    values = np.unique(np.round(covariate, 9))
    if len(values) <= _FEW_VALUES:
        middle = 0.5 * (values[1:] + values[:-1])
        return np.asarray(np.r_[-np.inf, middle, np.inf])
    edges = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, _BINS + 1)))
    edges[0], edges[-1] = -np.inf, np.inf
    return np.asarray(edges)


def _quartiles(axes: Axes, covariate: Floats, values: Floats, bins: Floats, index: int, ink: Ink) -> None:
    which = np.digitize(covariate, bins) - 1
    rows = []
    for b in range(len(bins) - 1):
        own = which == b
        if np.count_nonzero(own) >= _FEWEST:
            rows.append((float(np.median(covariate[own])), *np.quantile(values[own], [0.25, 0.5, 0.75]).tolist()))
    if not rows:
        return
    at, low, middle, high = np.array(rows).T
    shown = colour(index)
    line = "-" if len(rows) > _FEW_VALUES else "none"
    axes.vlines(at, low, high, color=shown, linewidth=1.4, alpha=0.45)
    axes.plot(
        at, middle, linestyle=line, linewidth=1.0, marker=marker(index), markersize=4, color=shown,
        markeredgecolor=ink.paper, markeredgewidth=0.5,
    )  # fmt: skip
