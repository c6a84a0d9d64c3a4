"""Simulator: one camera interval of the default plant, and a batch of frames, against the usual ways to compute them.

Peers: SciPy's `solve_ivp` on the plant's own (compiled) equations over the same interval; a rigid-body fit per frame by
NumPy's singular values. Run with ``python benchmarks/perf/perf_simulator.py``.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from agvbench.simulator import Camera, dynamics, load_plant
from agvbench.simulator.camera import FIVE_MARKERS
from agvbench.simulator.plants import THESIS_VEHICLE
from agvbench.types import Floats

ROUNDS, CALLS, FRAMES, DT = 9, 500, 1000, 1.0 / 120.0
COMMAND = (1000.0, 1300.0, 1620.0)


def per_call(call: Callable[[], object], calls: int) -> float:
    """Return µs per call."""
    start = time.perf_counter()
    for _ in range(calls):
        call()
    return 1e6 * (time.perf_counter() - start) / calls


def plant_pair() -> tuple[Callable[[], object], Callable[[], object]]:
    """Return: advance the checked default plant by a camera interval; the same by `solve_ivp`."""
    plant = load_plant("agvbench.simulator:make_plant")(0)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    plant.advance(*COMMAND, 1.0)
    constants, play = THESIS_VEHICLE.pack(), np.zeros(3)
    state, out = np.zeros(dynamics.STATE_SIZE), np.empty(dynamics.MOVING)
    state[dynamics.AIMS : dynamics.AIMS + 3] = 0.3, 0.2, -0.2
    state[dynamics.SPEED], state[dynamics.SLACK] = 0.25, 0.012

    def right_side(_t: float, at: Floats) -> Floats:
        dynamics._derivative(constants, play, state, at, out)
        return out.copy()

    def peer() -> object:
        return solve_ivp(right_side, (0.0, DT), state[: dynamics.MOVING], rtol=1e-6, atol=1e-9)

    return lambda: plant.advance(*COMMAND, DT), peer


def camera_pair() -> tuple[Callable[[], object], Callable[[], object]]:
    """Return: observe a batch of frames; fit one rigid body by singular values."""
    tracker = Camera().tracker(np.random.default_rng(0))
    times, poses = np.arange(FRAMES) / 120.0, np.zeros((FRAMES, 3))
    rng = np.random.default_rng(0)
    markers = np.array(FIVE_MARKERS) - np.mean(FIVE_MARKERS, axis=0)

    def peer() -> object:
        seen = markers + 0.0005 * rng.standard_normal((5, 2))
        centre = seen.mean(axis=0)
        u, _, vt = np.linalg.svd(markers.T @ (seen - centre))
        rotation = vt.T @ u.T
        return centre, np.arctan2(rotation[1, 0], rotation[0, 0]), rng.random(11)

    return lambda: tracker.observe(times, poses), peer


def main() -> int:
    """Print what | ours | peer | ratio | bound met?; return 0 if every bound is met."""
    plant, solver = plant_pair()
    camera, fit = camera_pair()
    for call in (plant, solver, camera, fit):
        call()  # compiles
    rounds = [
        (per_call(plant, CALLS), per_call(solver, 20), per_call(camera, 20) / FRAMES, per_call(fit, CALLS))
        for _ in range(ROUNDS)
    ]
    plant_us, solver_us, camera_us, fit_us = (statistics.median(column) for column in zip(*rounds, strict=True))
    rows = (
        ("default plant, 1/120 s [µs]", plant_us, "solve_ivp", solver_us, 50.0, 20.0),
        (f"camera, per frame of {FRAMES} [µs]", camera_us, "NumPy SVD", fit_us, 1.0, 20.0),
    )
    table = Table(title="simulator")
    for heading in ("what", "ours", "peer", "ratio", "bound met?"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    met = True
    for what, ours, name, peer, limit_us, least in rows:
        good = ours <= limit_us and peer >= least * ours
        met &= good
        verdict = f"{'yes' if good else 'NO'}: ≤ {limit_us:g} µs, ≥ {least:g}×"
        table.add_row(what, f"{ours:.2f}", f"{peer:.1f} ({name})", f"{peer / ours:.0f}× faster", verdict)
    Console().print(table)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
