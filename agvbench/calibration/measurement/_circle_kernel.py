"""The compiled circle fit: moments, an algebraic start, geometric Gauss–Newton steps.

A circle is described by a point on it near the middle of the arc, the direction φ of its tangent there, an offset d
along the left normal and the signed curvature κ (left positive). Unlike centre and radius this stays regular when the
arc becomes a straight line (κ = 0). With a = along and b = left of the tangent, the distance from a point to the
circle is e = (2b − κ(a² + b²)) / (1 + ρ), ρ = √((κa)² + (1 − κb)²), which has no difference of large numbers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.types import Floats

# Columns of a fit's row.
CENTER_X, CENTER_Y, RADIUS, SE_CENTER_X, SE_CENTER_Y, SE_RADIUS, RMS, ARC = range(8)
CURVATURE, SE_CURVATURE, POINT_X, POINT_Y, DIRECTION, SE_DIRECTION, POINTS = range(8, 15)
COLUMNS = 15

_MAX_PASSES = 40
# Every function but the last is inlined: one that is not exists twice in the process that compiles it, optimised alone
# and within its caller, and the first session after an installation would differ from the next in the last bits.
_FAST = {"reassoc", "contract", "arcp", "nsz"}  # NaN and infinity keep their meaning


@cached_njit(fastmath=_FAST, error_model="numpy", forceinline=True)
def _centroid(flat: Floats, x: Floats, y: Floats) -> tuple[float, float]:
    """Copy x₀, y₀, x₁, … into `x`, `y` relative to their centroid, which is returned (NaN if one is not finite)."""
    n = len(flat) // 2
    mean_x = mean_y = 0.0
    for i in range(n):
        u, v = flat[2 * i], flat[2 * i + 1]
        mean_x += u
        mean_y += v
        x[i] = u
        y[i] = v
    mean_x /= n
    mean_y /= n
    for i in range(n):
        x[i] -= mean_x
        y[i] -= mean_y
    return mean_x, mean_y


@cached_njit(fastmath=_FAST, error_model="numpy", forceinline=True)
def _moments(x: Floats, y: Floats, n: int) -> tuple[float, float, float, float, float, float]:
    xx = yy = xy = xz = yz = zz = 0.0
    for i in range(n):
        z = x[i] * x[i] + y[i] * y[i]
        xx += x[i] * x[i]
        yy += y[i] * y[i]
        xy += x[i] * y[i]
        xz += x[i] * z
        yz += y[i] * z
        zz += z * z
    return xx / n, yy / n, xy / n, xz / n, yz / n, zz / n


@cached_njit(error_model="numpy", forceinline=True)
def _hyper_root(xx: float, yy: float, xy: float, xz: float, yz: float, zz: float) -> float:
    """Return the smallest positive root of the characteristic polynomial of the Hyper fit, by Newton from 0."""
    z = xx + yy
    cov = xx * yy - xy * xy
    var_z = zz - z * z
    a2 = 4.0 * cov - 3.0 * z * z - zz
    a1 = var_z * z + 4.0 * cov * z - xz * xz - yz * yz
    a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - var_z * cov
    root, value = 0.0, a0
    for _ in range(50):
        slope = a1 + root * (2.0 * a2 + 16.0 * root * root)
        if slope == 0.0:
            break
        new = root - value / slope
        new_value = a0 + new * (a1 + new * (a2 + 4.0 * new * new))
        if new == root or not abs(new_value) < abs(value):
            break
        root, value = new, new_value
    return root


@cached_njit(error_model="numpy", forceinline=True)
def _start(xx: float, yy: float, xy: float, xz: float, yz: float, root: float) -> tuple[float, float, float, float]:
    """Return (point x, point y, direction, curvature) of the algebraic circle A z + B x + C y + D = 0."""
    z = xx + yy
    a = root * root - root * z + xx * yy - xy * xy
    b = yz * xy - xz * (yy - root)
    c = xz * xy - yz * (xx - root)
    d = -a * z
    size = math.sqrt(z)
    gradient = math.hypot(b, c)
    on_circle = math.sqrt(max(b * b + c * c - 4.0 * a * d, 0.0))
    if not on_circle > 1e-13 * size**5:
        # Nothing but a line, symmetric about its centroid: the principal axis.
        return 0.0, 0.0, 0.5 * math.atan2(2.0 * xy, xx - yy), 0.0
    if gradient < 1e-6 * on_circle:
        # A whole circle about its centroid: any point on it will do.
        normal_x, normal_y, away = 1.0, 0.0, on_circle / (2.0 * a)
    else:
        normal_x, normal_y, away = b / gradient, c / gradient, -2.0 * d / (gradient + on_circle)
    direction = math.atan2(normal_x, -normal_y)
    return away * normal_x, away * normal_y, direction, 2.0 * a / on_circle


@cached_njit(fastmath=_FAST, error_model="numpy", forceinline=True)
def _distances(
    x: Floats, y: Floats, n: int, px: float, py: float, direction: float, offset: float, curvature: float, work: Floats
) -> None:
    """Write the signed distances and their derivatives by direction, offset and curvature to the rows of `work`."""
    cos, sin = math.cos(direction), math.sin(direction)
    turn = -(1.0 + curvature * offset)
    distance, by_direction, by_offset, by_curvature = work[0], work[1], work[2], work[3]
    for i in range(n):
        dx, dy = x[i] - px, y[i] - py
        a = cos * dx + sin * dy
        b = cos * dy - sin * dx - offset
        r2 = a * a + b * b
        q = 2.0 * b - curvature * r2
        rho = math.sqrt(max(1.0 - curvature * q, 1e-30))
        inverse = 1.0 / (rho * (1.0 + rho))
        over_rho = inverse * (1.0 + rho)
        e = q * inverse * rho
        distance[i] = e
        by_direction[i] = turn * a * over_rho
        by_offset[i] = (curvature * b - 1.0) * over_rho
        by_curvature[i] = (e * (b - curvature * r2) - r2 * rho) * inverse


@cached_njit(fastmath=_FAST, error_model="numpy", forceinline=True)
def _accumulate(
    x: Floats, y: Floats, n: int, px: float, py: float, direction: float, offset: float, curvature: float, work: Floats
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Return the sum of squared distances, its gradient/2 and JᵀJ over (direction, offset, curvature)."""
    # Two loops, because one with both square roots and ten sums does not fit the vector registers.
    _distances(x, y, n, px, py, direction, offset, curvature, work)
    distance, by_direction, by_offset, by_curvature = work[0], work[1], work[2], work[3]
    sse = g0 = g1 = g2 = h00 = h01 = h02 = h11 = h12 = h22 = 0.0
    for i in range(n):
        e, j0, j1, j2 = distance[i], by_direction[i], by_offset[i], by_curvature[i]
        sse += e * e
        g0 += j0 * e
        g1 += j1 * e
        g2 += j2 * e
        h00 += j0 * j0
        h01 += j0 * j1
        h02 += j0 * j2
        h11 += j1 * j1
        h12 += j1 * j2
        h22 += j2 * j2
    return sse, g0, g1, g2, h00, h01, h02, h11, h12, h22


@cached_njit(fastmath=True, error_model="numpy", forceinline=True)
def _arc(x: Floats, y: Floats, n: int, px: float, py: float, direction: float, curvature: float) -> float:
    """Return the angle [rad] that the points span about the centre, seen from the middle of the arc."""
    cos, sin = math.cos(direction), math.sin(direction)
    ahead = behind = 1.0  # cosines of the farthest points on either side
    farthest = nearest = 0.0  # and their distances along the tangent
    for i in range(n):
        dx, dy = x[i] - px, y[i] - py
        c = 1.0 - curvature * (cos * dy - sin * dx)
        a = cos * dx + sin * dy
        ahead = min(ahead, c if a > 0.0 else 1.0)
        behind = min(behind, 1.0 if a > 0.0 else c)
        farthest = max(farthest, a)
        nearest = min(nearest, a)
    arc: float = _side(ahead, abs(curvature) * farthest) + _side(behind, -abs(curvature) * nearest)
    return arc


@cached_njit(error_model="numpy", forceinline=True)
def _side(cosine: float, sine: float) -> float:
    """Return the angle of the farthest point on one side, from whichever of its functions noise disturbs less."""
    return math.asin(min(sine, 1.0)) if cosine > 0.5 else math.acos(max(cosine, -1.0))


@cached_njit(error_model="numpy", forceinline=True)
def _inverse(
    h00: float, h01: float, h02: float, h11: float, h12: float, h22: float
) -> tuple[float, float, float, float, float, float]:
    """Return the inverse of a symmetric 3 × 3 matrix, upper triangle by rows; NaN if it is not positive definite."""
    c00, c01, c02 = h11 * h22 - h12 * h12, h02 * h12 - h01 * h22, h01 * h12 - h02 * h11
    det = h00 * c00 + h01 * c01 + h02 * c02
    if not det > 0.0:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    c11, c12, c22 = h00 * h22 - h02 * h02, h01 * h02 - h00 * h12, h00 * h11 - h01 * h01
    return c00 / det, c01 / det, c02 / det, c11 / det, c12 / det, c22 / det


@cached_njit(error_model="numpy", forceinline=True)
def _refine(
    x: Floats,
    y: Floats,
    n: int,
    px: float,
    py: float,
    direction: float,
    curvature: float,
    passes: int,
    negligible: float,
    work: Floats,
) -> tuple[float, float, float, float, tuple[float, float, float, float, float, float]]:
    """Return direction, offset, curvature, sum of squares and (JᵀJ)⁻¹ after at most `passes` Gauss–Newton steps."""
    offset = 0.0
    now = _accumulate(x, y, n, px, py, direction, offset, curvature, work)
    cov = _inverse(now[4], now[5], now[6], now[7], now[8], now[9])
    for _ in range(passes):
        sse, g0, g1, g2 = now[0], now[1], now[2], now[3]
        s0 = -(cov[0] * g0 + cov[1] * g1 + cov[2] * g2)
        s1 = -(cov[1] * g0 + cov[3] * g1 + cov[4] * g2)
        s2 = -(cov[2] * g0 + cov[4] * g1 + cov[5] * g2)
        gain = -(g0 * s0 + g1 * s1 + g2 * s2)  # what the step should take off the sum of squares
        if not gain > negligible:
            break
        if gain <= 1e-4 * sse / n:
            # A step of a hundredth of a standard error, and what is left after it is far smaller: do not look again.
            return direction + s0, offset + s1, curvature + s2, sse - gain, cov
        step = 1.0
        trial = _accumulate(x, y, n, px, py, direction + s0, offset + s1, curvature + s2, work)
        while not trial[0] <= sse and step > 1e-4:
            step *= 0.5
            trial = _accumulate(x, y, n, px, py, direction + step * s0, offset + step * s1, curvature + step * s2, work)
        if not trial[0] <= sse:
            break
        direction, offset, curvature, now = direction + step * s0, offset + step * s1, curvature + step * s2, trial
        cov = _inverse(now[4], now[5], now[6], now[7], now[8], now[9])
    return direction, offset, curvature, now[0], cov


@cached_njit(error_model="numpy", forceinline=True)
def _write_circle(
    row: Floats,
    x0: float,
    y0: float,
    direction: float,
    curvature: float,
    variance: float,
    cov: tuple[float, float, float, float, float, float],
) -> None:
    """Write centre and radius with their standard errors: centre = point + n/κ, R = 1/|κ|, by the delta method."""
    c00, c01, c02, c11, c12, c22 = cov
    tx, ty, radius = math.cos(direction), math.sin(direction), 1.0 / curvature
    row[CENTER_X] = x0 - radius * ty
    row[CENTER_Y] = y0 + radius * tx
    row[RADIUS] = abs(radius)
    row[SE_RADIUS] = radius * radius * math.sqrt(variance * c22)
    # The centre moves along the tangent by −R·Δφ and along the normal by Δd − R²·Δκ.
    along = radius * radius * c00
    left = radius**4 * c22 - 2.0 * radius * radius * c12 + c11
    both = -radius * (c01 - radius * radius * c02)
    cross = 2.0 * both * tx * ty
    row[SE_CENTER_X] = math.sqrt(variance * max(along * tx * tx + left * ty * ty - cross, 0.0))
    row[SE_CENTER_Y] = math.sqrt(variance * max(along * ty * ty + left * tx * tx + cross, 0.0))


@cached_njit(error_model="numpy", forceinline=True)
def _fit(flat: Floats, algebraic: bool, work: Floats, row: Floats) -> None:
    n = len(flat) // 2
    x, y = work[4], work[5]
    row[:] = np.nan
    row[POINTS] = n
    if n < 4:
        return
    mean_x, mean_y = _centroid(flat, x, y)
    xx, yy, xy, xz, yz, zz = _moments(x, y, n)
    if not (math.isfinite(zz) and xx + yy > 0.0):
        return
    root = 0.0 if algebraic else _hyper_root(xx, yy, xy, xz, yz, zz)
    px, py, direction, curvature = _start(xx, yy, xy, xz, yz, root)
    passes = 0 if algebraic else _MAX_PASSES
    negligible = 1e-30 * n * (xx + yy + mean_x * mean_x + mean_y * mean_y)
    direction, offset, curvature, sse, cov = _refine(x, y, n, px, py, direction, curvature, passes, negligible, work)
    if not cov[0] > 0.0:
        return
    variance = max(sse, 0.0) / (n - 3)
    px -= offset * math.sin(direction)
    py += offset * math.cos(direction)
    row[ARC] = _arc(x, y, n, px, py, direction, curvature)
    row[RMS] = math.sqrt(max(sse, 0.0) / n)
    row[CURVATURE] = curvature
    row[SE_CURVATURE] = math.sqrt(variance * cov[5])
    row[POINT_X] = mean_x + px
    row[POINT_Y] = mean_y + py
    row[DIRECTION] = direction
    row[SE_DIRECTION] = math.sqrt(variance * cov[0])
    row[RADIUS] = np.inf
    if curvature != 0.0:
        _write_circle(row, mean_x + px, mean_y + py, direction, curvature, variance, cov)


@cached_njit(error_model="numpy")
def fit_batch(points: Any, starts: Any, algebraic: Any) -> Any:
    """Fit one circle to each slice ``points[starts[k]:starts[k + 1]]``; return rows of `COLUMNS` numbers."""
    fits = len(starts) - 1
    flat = points.reshape(-1)
    rows = np.empty((fits, COLUMNS))
    longest = 0
    for k in range(fits):
        longest = max(longest, starts[k + 1] - starts[k])
    work = np.empty((6, longest))
    for k in range(fits):
        _fit(flat[2 * starts[k] : 2 * starts[k + 1]], algebraic, work, rows[k])
    return rows
