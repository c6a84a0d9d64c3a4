"""Small drawings, written as SVG directly: end positions about a target, and the way that a trajectory leads."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from agvbench.plot.style import CONDITION_COLOURS, MARKERS
from agvbench.statistics.pose_accuracy import prediction_ellipse
from agvbench.types import Floats

_LEAST_MM = 2.0
_STEPS = (0.5, 1.0, 2.0, 5.0)
_CLOUD, _SKETCH = 120.0, 40.0
_SKETCHED = 40
_OUTLINES = {"s": "M-2,-2h4v4h-4z", "^": "M0,-2.6L2.4,2H-2.4z", "D": "M0,-2.8L2.8,0L0,2.8L-2.8,0z"}
_OUTLINES |= {"v": "M0,2.6L2.4,-2H-2.4z", "P": "M-1,-3h2v2h2v2h-2v2h-2v-2h-2v-2h2z"}
_ROUND = "M-2.2,0a2.2,2.2 0 1,0 4.4,0a2.2,2.2 0 1,0 -4.4,0z"
_CIRCLE = np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0.0, 2.0 * math.pi, 49)]).T


def scale_of(trajectories: Iterable[Mapping[int, Floats]]) -> tuple[float, float]:
    """Return the radius of the ring [mm], 1, 2 or 5 times a power of ten, and half the width [mm] of all panels.

    Parameters
    ----------
    trajectories
        What each panel draws: points by the number of their condition, shape (n, 2) or wider, mm from the target.
    """
    drawn = [points for by_condition in trajectories for ends in by_condition.values() for points in _outline(ends)]
    half_mm = 1.08 * max(_LEAST_MM, *(float(np.abs(points).max()) for points in drawn))
    power = 10.0 ** math.floor(math.log10(half_mm))
    return max(step * power for step in _STEPS if step * power <= 0.9 * half_mm), half_mm


def draw_cloud(ends: Mapping[int, Floats], *, ring_mm: float, half_mm: float) -> str:
    """Return an SVG of end positions by the number of their condition, shape (n, 2) or wider, with their ellipses."""
    half, scale = _CLOUD / 2.0, _CLOUD / 2.0 / half_mm
    parts = [
        f'<circle r="{ring_mm * scale:.1f}" fill="none" stroke="var(--rule)"/>',
        f'<path d="M-{half:g},0H{half:g}M0,-{half:g}V{half:g}" stroke="var(--grid)"/>',
    ]
    for number, points in ends.items():
        colour = f"var(--c{number % len(CONDITION_COLOURS)})"
        _, *ellipse = _outline(points)
        parts += [f'<polygon points="{_joined(e * scale)}" fill="none" stroke="{colour}"/>' for e in ellipse]
        shape = _OUTLINES.get(MARKERS[number % len(MARKERS)], _ROUND)
        parts += [
            f'<path d="{shape}" fill="{colour}" transform="translate({x:.1f},{-y:.1f})"/>'
            for x, y in scale * points[:, :2]
        ]
    parts.append('<path d="M-5,0H5M0,-5V5" stroke="var(--ink)" stroke-width="1.3"/>')
    return f'<svg viewBox="{-half:g} {-half:g} {_CLOUD:g} {_CLOUD:g}" role="img">{"".join(parts)}</svg>'


def _outline(ends: Floats) -> list[Floats]:
    """Return the points (n, 2) [mm], n > 0, and their ellipse (m, 2) [mm] where they have one."""
    points = ends[:, :2]
    ellipse = prediction_ellipse(points)
    return [points] if ellipse is None else [points, (ellipse[0][:, np.newaxis] + ellipse[1] @ _CIRCLE).T]


def sketch(path: Floats) -> str:
    """Return a small SVG of a way (n, 2) [m] from its start (hollow) to its end (filled), for a summary line.

    It is decoration: the words beside it say where the trajectory leads.
    """
    low, high = path.min(axis=0), path.max(axis=0)
    scale = 0.7 * _SKETCH / max(float((high - low).max()), 1e-3)
    chosen = path[np.linspace(0, len(path) - 1, min(_SKETCHED, len(path))).round().astype(int)]
    drawn = scale * (chosen - (low + high) / 2.0)
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{-y:.1f}" r="3" fill="{fill}" stroke="var(--ink)" stroke-width="1.5"/>'
        for (x, y), fill in ((drawn[0], "none"), (drawn[-1], "var(--ink)"))
    )
    box = f"{-_SKETCH / 2:g} {-_SKETCH / 2:g} {_SKETCH:g} {_SKETCH:g}"
    line = f'<polyline points="{_joined(drawn)}" fill="none" stroke="var(--muted)" stroke-width="2"/>'
    return f'<svg viewBox="{box}" aria-hidden="true">{line}{dots}</svg>'


def _joined(points: Floats) -> str:
    return " ".join(f"{x:.1f},{-y:.1f}" for x, y in points)
