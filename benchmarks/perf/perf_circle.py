"""Circle fit: accuracy against the Cramér–Rao bound, and time per fit against circle-fit's hyperLSQ.

1000 arcs of 60–180°, R = 2 m, 300 points, 0.5 mm noise. Run with ``python benchmarks/perf/perf_circle.py``.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from circle_fit import hyperLSQ
from rich.console import Console
from rich.table import Table

from agvbench.calibration import fit_circles
from agvbench.types import Floats

ARCS, POINTS, RADIUS_M, NOISE_M, ROUNDS = 1000, 300, 2.0, 5e-4, 15


def make_arcs(seed: int) -> tuple[Floats, Floats, Floats]:
    """Return noisy points (arcs, points, 2), true (cx, cy, R) and the lower bounds of their variances."""
    rng = np.random.default_rng(seed)
    span = np.radians(rng.uniform(60, 180, ARCS))
    angle = rng.uniform(0, 2 * np.pi, ARCS)[:, None] + span[:, None] * np.linspace(0, 1, POINTS)
    center = rng.uniform(-3, 3, (ARCS, 2))
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = center[:, None] + RADIUS_M * normal + NOISE_M * rng.standard_normal(normal.shape)
    jacobian = np.concatenate([normal, np.ones((ARCS, POINTS, 1))], axis=-1)
    covariance = np.linalg.inv(jacobian.transpose(0, 2, 1) @ jacobian) * NOISE_M**2
    return points, np.column_stack([center, np.full(ARCS, RADIUS_M)]), np.diagonal(covariance, axis1=1, axis2=2)


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def main() -> int:
    """Print what | ours | peer | ratio | bound met?; return 0 if every bound is met."""
    points, true, bound = make_arcs(seed=1)

    def ours() -> Floats:
        fits = fit_circles(points)
        return np.column_stack([fits.center, fits.radius])

    def peer() -> Floats:
        return np.array([hyperLSQ(arc)[:3] for arc in points])

    efficiency = [float(np.sqrt(np.mean((fit() - true) ** 2 / bound))) for fit in (ours, peer)]  # compiles, too
    pairs = [(seconds(ours), seconds(peer)) for _ in range(ROUNDS)]
    micros = [1e6 * statistics.median(times) / ARCS for times in zip(*pairs, strict=True)]
    ratio = statistics.median(theirs / mine for mine, theirs in pairs)

    table = Table(title=f"circle fit, {ARCS} arcs of 60–180°, {POINTS} points, {1e3 * NOISE_M} mm")
    for heading in ("what", "ours", "hyperLSQ", "ratio", "bound met?"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    accurate, fast = efficiency[0] <= 1.05, ratio >= 20.0
    table.add_row(
        "RMSE / Cramér–Rao",
        *(f"{e:.4f}" for e in efficiency),
        f"{efficiency[0] / efficiency[1]:.3f}",
        f"{'yes' if accurate else 'NO'}: ≤ 1.05",
    )
    table.add_row(
        "µs per fit, batched",
        *(f"{t:.2f}" for t in micros),
        f"{ratio:.1f}× faster",
        f"{'yes' if fast else 'NO'}: ≥ 20×",
    )
    Console().print(table)
    return 0 if accurate and fast else 1


if __name__ == "__main__":
    sys.exit(main())
