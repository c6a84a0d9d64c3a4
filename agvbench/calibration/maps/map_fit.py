"""The result of a fit of a static map: residuals, R², points left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError
from agvbench.types import Floats
from agvbench.vehicle.maps import StaticMap


@dataclass(frozen=True)
class ExcludedPoint:
    """A point that a fit was not made from, and why."""

    command: float
    value: float
    why: str


@dataclass(frozen=True)
class MapFit:
    """A static map and how well it fits: rad for steering, m/s for the drive.

    ``name`` of the fit (``"line"``, ``"cubic"``, ``"thesis"`` …); ``r_squared`` and ``residual_sd`` (with degrees of
    freedom) over the points the fit was made from, as in thesis table 7.5; ``rms_all`` over all points, those
    ``left_out`` included; ``stderr`` of each parameter; ``points`` measured and ``used`` of them;
    ``cross_validated_rms``: over all points but the outermost, each predicted by a fit to the others (NaN if not
    asked for); ``notes`` in plain words.
    """

    name: str
    map: StaticMap
    r_squared: float
    residual_sd: float
    rms_all: float
    stderr: Mapping[str, float]
    points: CurvePoints
    used: NDArray[np.bool_]
    left_out: tuple[ExcludedPoint, ...] = ()
    notes: tuple[str, ...] = ()
    cross_validated_rms: float = field(default=np.nan)


def assess_map(
    name: str,
    static_map: StaticMap,
    points: CurvePoints,
    *,
    parameters: int,
    stderr: Mapping[str, float],
    reasons: Mapping[float, str] | None = None,
    notes: tuple[str, ...] = (),
    curve: Floats | None = None,
) -> MapFit:
    """Return the `MapFit` of a map fitted to all points whose command has no reason to be left out.

    `curve` holds the fitted values where they are not the map's own (a cubic beyond its monotone stretch).
    """
    reasons = reasons or {}
    used = without(points, reasons)
    mapped = static_map(points.command)
    residual = points.value - (mapped if curve is None else curve)
    freedom = max(int(np.count_nonzero(used)) - parameters, 1)
    return MapFit(
        name=name,
        map=static_map,
        r_squared=r_squared(points.value[used], residual[used]),
        residual_sd=float(np.sqrt(np.sum(residual[used] ** 2) / freedom)),
        rms_all=float(np.sqrt(np.mean((points.value - mapped) ** 2))),
        stderr=dict(stderr),
        points=points,
        used=used,
        left_out=tuple(
            ExcludedPoint(c, float(points.value[points.command == c][0]), why) for c, why in reasons.items()
        ),
        notes=notes,
    )


def without(points: CurvePoints, reasons: Mapping[float, str] | None) -> NDArray[np.bool_]:
    """Return which points have no reason to be left out."""
    out = reasons or {}
    return np.array([c not in out for c in points.command.tolist()], dtype=np.bool_)


def require_points(points: CurvePoints, least: int, what: str) -> None:
    """Raise `FitError` unless there are `least` different commands."""
    if len(points) < least:
        raise FitError(f"too few commands for a {what}", value=len(points), limit=f"at least {least}")


def rounded(value: float) -> float:
    """Return so many digits that the last ones of another machine's arithmetic do not show."""
    return float(f"{value:.12g}") + 0.0


def r_squared(value: Floats, residual: Floats) -> float:
    """Return the share of variance explained, 1 − Σe²/Σ(y − ȳ)²; NaN where nothing varies."""
    total = float(np.sum((value - value.mean()) ** 2)) if len(value) else 0.0
    return 1.0 - float(np.sum(residual**2)) / total if total > 0.0 else np.nan
