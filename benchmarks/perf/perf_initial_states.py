"""How well the speed at the beginning of a window is known: the motion filter against a parabola through 0.2 s.

Recordings of other labs are thinned to several frame rates. The reference is a parabola through later and earlier
frames of the whole recording (Savitzky–Golay, 9 frames). Printed: root mean square of the error of the longitudinal
speed, and of the filter's error over the standard error that it states (1 is right). The recordings are looked for in
``$AGVBENCH_MEASURED``, else in a folder ``shared/measured`` beside the project's. Run with
``python benchmarks/perf/perf_initial_states.py``.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table
from scipy.signal import savgol_filter

from agvbench.diagnosis.data.motion_filter import MotionFilter

ROOT = Path(__file__).resolve().parents[2]
FILES = ("cpm/identification_a.csv", "cpm/identification_b.csv", "eth/driving_1.csv")
SUPPORT_S, REFERENCE_FRAMES = 0.2, 9


def reference(t_s: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the longitudinal speed (n,) from frames on both sides."""
    step_s = float(np.median(np.diff(t_s)))
    vx, vy = (savgol_filter(motion[:, k], REFERENCE_FRAMES, 2, 1, step_s) for k in (0, 1))
    heading = savgol_filter(motion[:, 2], REFERENCE_FRAMES, 2)
    return np.asarray(np.cos(heading) * vx + np.sin(heading) * vy)


def parabolas(t_s: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the longitudinal speed (n,) of parabolas through the last 0.2 s; NaN with fewer than four frames."""
    out = np.full(len(t_s), np.nan)
    for k in range(len(t_s)):
        own = slice(int(np.searchsorted(t_s, t_s[k] - SUPPORT_S)), k + 1)
        if own.stop - own.start >= 4:
            (_, _, heading), (vx, vy, _), _ = np.polynomial.polynomial.polyfit(t_s[own] - t_s[k], motion[own], 2)
            out[k] = np.cos(heading) * vx + np.sin(heading) * vy
    return out


def main() -> int:
    """Print the table."""
    console = Console(width=None if sys.stdout.isatty() else 120)
    where = Path(os.environ.get("AGVBENCH_MEASURED") or ROOT.parent / "shared" / "measured")
    table = Table("recording", "frames/s", "filter, mm/s", "parabola, mm/s", "filter: error / stated error")
    for name in FILES:
        if not (where / name).exists():
            console.print(f"{where / name} is missing: set AGVBENCH_MEASURED to the directory that has it")
            return 2
        data = pd.read_csv(where / name)
        t_s = data["t_s"].to_numpy()
        motion = np.column_stack([data["x_m"], data["y_m"], np.unwrap(data["heading_rad"])])
        truth = reference(t_s, motion)
        for every in (1, 2, 5, 10):
            thin_t, thin = t_s[::every], motion[::every]
            states = MotionFilter.fitted([(thin_t, thin)]).states(thin_t, thin)
            kept = slice(20, -REFERENCE_FRAMES)
            error = (states.longitudinal_speed() - truth[::every])[kept]
            stated = np.hypot(*states.velocity_stderr[kept, :2].T) / np.sqrt(2.0)
            other = (parabolas(thin_t, thin) - truth[::every])[kept]
            old = "–" if np.isnan(other).all() else f"{1e3 * np.sqrt(np.nanmean(other**2)):.1f}"
            ours, ratio = f"{1e3 * np.sqrt(np.mean(error**2)):.1f}", f"{np.sqrt(np.mean((error / stated) ** 2)):.2f}"
            table.add_row(name, f"{1.0 / np.median(np.diff(thin_t)):.0f}", ours, old, ratio)
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
