"""Circles through partial arcs: centre, radius and how well the points determine them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agvbench.calibration.measurement import _circle_kernel as kernel
from agvbench.errors import InputError, NotAnArcError, OneOf
from agvbench.types import Floats

CircleMethod = Literal["default", "landau_smith"]

MIN_POINTS = 8
MIN_ARC_RAD = math.radians(10.0)
MIN_BOW_SIGMAS = 8.0
MIN_CURVATURE_SIGMAS = 10.0


@dataclass(frozen=True)
class CircleFit:
    """One fitted circle.

    ``center`` [m] has shape (2,), as has ``center_stderr``; ``radius``, ``radius_stderr`` [m]; ``rms`` [m] of the
    distances from the points to the circle; ``arc_rad`` the angle that the points span.
    """

    center: Floats
    radius: float
    center_stderr: Floats
    radius_stderr: float
    rms: float
    arc_rad: float


@dataclass(frozen=True)
class CircleFits:
    """Many fitted circles: the fields of `CircleFit` with a leading axis, NaN where ``reason`` is not empty.

    ``reason`` holds, for each, why its points are no arc (``"not an arc: …"``) or an empty string.
    """

    center: Floats
    radius: Floats
    center_stderr: Floats
    radius_stderr: Floats
    rms: Floats
    arc_rad: Floats
    reason: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.radius)

    def __getitem__(self, index: int) -> CircleFit:
        """Return one fit; raises `NotAnArcError` if its points are no arc."""
        if self.reason[index]:
            raise NotAnArcError(self.reason[index])
        return CircleFit(
            self.center[index],
            float(self.radius[index]),
            self.center_stderr[index],
            float(self.radius_stderr[index]),
            float(self.rms[index]),
            float(self.arc_rad[index]),
        )


def fit_circle(points: ArrayLike, method: CircleMethod = "default") -> CircleFit:
    """Fit a circle to points on an arc.

    ``"default"`` minimises the squared distances from the points to the circle (Gauss–Newton from the Hyper
    fit of Al-Sharadqah & Chernov 2009): it attains the Cramér–Rao bound on arcs of 60° and more.
    ``"landau_smith"`` is what the thesis used (section 6.2.2): Thomas & Chan 1989, the closed form that minimises
    Σ (dᵢ² − R²)². It weights points by the radius, and pulls centre and radius inward on short and noisy arcs.
    Standard errors come from the geometric Fisher information at the solution, σ²(JᵀJ)⁻¹ with σ² = Σe²/(n − 3).

    **When are points an arc?** Three questions are put to the data, because a radius can always be computed:

    - Is the noise known? Three parameters leave n − 3 degrees of freedom; below 8 points σ itself is uncertain by
      more than a third, and no standard error means anything.
    - Is the path bent? The bow of the arc, R(1 − cos(α/2)), must exceed the noise of a single point 8 times,
      and the curvature its standard error 10 times. The bow is not divided by √n: a tracker's error is
      shared by neighbouring frames, and averaging would underestimate it. A cloud of points (full circle, bow 2R) fails
      here, too.
    - Is the arc long enough to distinguish a circle from a path of varying curvature? At least 10°, however
      small the noise: below, anything smooth is an arc.

    Parameters
    ----------
    points
        Shape (n, 2) [m], in any order.
    method
        ``"default"`` or ``"landau_smith"``.

    Raises
    ------
    NotAnArcError
        With the numbers, if the points are too few, not finite, straight within their noise, or too short an arc.
    InputError
        If `points` has another shape or `method` is unknown.

    Examples
    --------
    >>> angle = np.linspace(0.0, 1.5, 50)
    >>> fit = fit_circle(np.column_stack([1.0 + 2.0 * np.cos(angle), 2.0 * np.sin(angle)]))
    >>> (fit.center.round(9) + 0.0).tolist(), round(fit.radius, 9), round(fit.arc_rad, 6)
    ([1.0, 0.0], 2.0, 1.5)
    >>> fit_circle([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    Traceback (most recent call last):
    agvbench.errors.NotAnArcError: not an arc: 3 points (limit: at least 8)
    """
    array = _as_points(points, "points")
    return fit_circles([array], method)[0]


def fit_circles(batch: ArrayLike | Sequence[ArrayLike], method: CircleMethod = "default") -> CircleFits:
    """Fit a circle to each of many arcs; what is no arc gets a reason instead of an error.

    Parameters
    ----------
    batch
        Shape (k, n, 2) [m], or a sequence of k arrays of shape (nᵢ, 2).
    method
        See `fit_circle`.

    Raises
    ------
    InputError
        If `batch` has another shape or `method` is unknown.
    """
    if method not in ("default", "landau_smith"):
        known = OneOf(("default", "landau_smith"))
        raise InputError("unknown circle fit", where="method", value=repr(method), limit=known)
    rows = kernel.fit_batch(*_flatten(batch), method == "landau_smith")
    reason = tuple(_complaints(rows))
    fits = rows[:, : kernel.ARC + 1].copy()
    fits[np.array([text != "" for text in reason], dtype=np.bool_)] = np.nan
    return CircleFits(
        center=fits[:, kernel.CENTER_X : kernel.CENTER_Y + 1],
        radius=fits[:, kernel.RADIUS],
        center_stderr=fits[:, kernel.SE_CENTER_X : kernel.SE_CENTER_Y + 1],
        radius_stderr=fits[:, kernel.SE_RADIUS],
        rms=fits[:, kernel.RMS],
        arc_rad=fits[:, kernel.ARC],
        reason=reason,
    )


def _complaints(rows: Floats) -> list[str]:
    """Return for each row why its points are no arc, or an empty string: all rows at once, words only where needed."""
    points, rms, arc, curvature = (rows[:, c] for c in (kernel.POINTS, kernel.RMS, kernel.ARC, kernel.CURVATURE))
    with np.errstate(divide="ignore", invalid="ignore"):
        bow = (1.0 - np.cos(np.minimum(arc, 2.0 * np.pi) / 2.0)) / np.abs(curvature)
        certain = np.abs(curvature) >= MIN_CURVATURE_SIGMAS * rows[:, kernel.SE_CURVATURE]
        good = (points >= MIN_POINTS) & (arc >= MIN_ARC_RAD) & (bow >= MIN_BOW_SIGMAS * rms) & certain
    reasons = [""] * len(rows)
    for k in np.flatnonzero(~good):
        reasons[k] = _complaint(rows[k], float(bow[k]))
    return reasons


def _complaint(row: Floats, bow: float) -> str:
    points, rms, arc = int(row[kernel.POINTS]), row[kernel.RMS], row[kernel.ARC]
    if points < MIN_POINTS:
        return f"not an arc: {points} points (limit: at least {MIN_POINTS})"
    if math.isnan(row[kernel.CURVATURE]):
        return f"not an arc: {points} points, not all of them finite, or all in one place"
    noise = f"{1e3 * rms:.3g} mm noise"
    if not bow >= MIN_BOW_SIGMAS * rms:
        limit = f"(limit: {MIN_BOW_SIGMAS:g} times the noise)"
        return f"not an arc: straight within its noise, a bow of {1e3 * bow:.3g} mm in {noise} {limit}"
    if not abs(row[kernel.CURVATURE]) >= MIN_CURVATURE_SIGMAS * row[kernel.SE_CURVATURE]:
        measured = f"{row[kernel.CURVATURE]:.3g} ± {row[kernel.SE_CURVATURE]:.2g} 1/m"
        return f"not an arc: curvature {measured} (limit: {MIN_CURVATURE_SIGMAS:g} standard errors)"
    limit = f"(limit: at least {math.degrees(MIN_ARC_RAD):.0f}°)"
    return f"not an arc: {math.degrees(arc):.1f}° of a circle, {noise} {limit}"


def _as_points(points: ArrayLike, where: str) -> Floats:
    try:
        array = np.ascontiguousarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("points are not numbers", where=where, limit="shape (n, 2)") from None
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError("points have the wrong shape", where=where, value=array.shape, limit="shape (n, 2)")
    return array


def _flatten(batch: ArrayLike | Sequence[ArrayLike]) -> tuple[Floats, np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """Return all points below one another, and where each arc starts (and the last one ends)."""
    if isinstance(batch, np.ndarray) and batch.dtype != np.object_:
        if batch.ndim != 3 or batch.shape[2] != 2:
            raise InputError("points have the wrong shape", where="batch", value=batch.shape, limit="shape (k, n, 2)")
        count, each, _ = batch.shape
        return np.ascontiguousarray(batch, np.float64).reshape(-1, 2), np.arange(count + 1, dtype=np.int64) * each
    arcs = [_as_points(points, f"batch[{k}]") for k, points in enumerate(batch)]  # type: ignore[arg-type]
    starts = np.cumsum([0, *map(len, arcs)], dtype=np.int64)
    return np.concatenate([np.empty((0, 2)), *arcs]), starts
