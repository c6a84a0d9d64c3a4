"""Runs and tables of errors with a known truth."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from agvbench.types import Commands, Frames, Pose, Run

TARGETS = {
    "1_forward": (2.0, 0.0, 0.0),
    "2_backward": (-2.0, 0.0, 0.0),
    "3_forward_half": (2.0, 0.0, 0.0),
    "4_backward_half": (-2.0, 0.0, 0.0),
    "5_forward_left": (1.0, 1.0, math.pi / 2),
    "6_forward_right": (1.0, -1.0, -math.pi / 2),
    "7_backward_left": (-1.0, 1.0, -math.pi / 2),
    "8_backward_right": (-1.0, -1.0, math.pi / 2),
}
OTHERS = {"parallel_park": (0.0, -0.5, 0.0)}
AHEAD = Pose(2.0, 0.0, 0.0)


def make_run(start, end, *, target=AHEAD, noise_m=0.0, settle_s=0.0, seed=0, rate_hz=100.0, **changes):
    """Return a run that rests at `start` for 0.6 s, drives 1 s to `end`, settles there and rests for 1 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(-0.6, 2.0 + 1e-9, 1.0 / rate_hz)
    share = np.clip(t, 0.0, 1.0)
    if settle_s:
        share = np.where(t > 1.0, 1.0 + 0.02 * np.exp(-(t - 1.0) / settle_s), share)
    xyh = np.array(start) + share[:, None] * (np.array(end) - np.array(start))
    xyh[:, :2] += noise_m * rng.standard_normal((len(t), 2))
    xyh[:, 2] += noise_m * 5.0 * rng.standard_normal(len(t))
    none = np.full(len(t), np.nan)
    frames = Frames(t, *xyh.T, np.ones(len(t), np.bool_), np.arange(len(t)), none, none)
    commands = Commands(np.array([0.0, 1.0]), np.array([900.0, 1500.0]), np.full(2, 1500.0), np.full(2, 1500.0))
    facts = {
        "run_id": "r1",
        "experiment": "trajectory",
        "trajectory": "1_forward",
        "condition": "calibrated",
        "repeat": 0,
        "target": target,
        "started_s": 0.0,
        "status": "ok",
        "firmware": "sim",
        "commands": commands,
        "frames": frames,
    }
    return Run(**(facts | changes))


def error_table(draw, *, repeats, trajectories=tuple(TARGETS), conditions=("uncalibrated", "calibrated"), shift=()):
    """Return a table of errors along, across and of heading from ``draw(size)``, plus ``shift[trajectory, condition]``.

    A shift is along [mm], of the heading [deg] and, if given, across [mm]. Δs is the error along.
    """
    shift = dict(shift)
    rows = []
    for trajectory in trajectories:
        for condition in conditions:
            extra = (*shift.get((trajectory, condition), (0.0, 0.0)), 0.0)
            along, heading, across = draw(repeats) + extra[0], draw(repeats) / 10.0 + extra[1], draw(repeats) + extra[2]
            rows += [
                {
                    "run_id": f"{trajectory}-{condition}-{repeat}",
                    "trajectory": trajectory,
                    "condition": condition,
                    "repeat": repeat,
                    "session": "",
                    "status": "ok",
                    "problem": "",
                    **dict(
                        zip(
                            ("target_x_m", "target_y_m", "target_heading_rad"),
                            (TARGETS | OTHERS)[trajectory],
                            strict=True,
                        )
                    ),
                    "position_mm": math.hypot(along[repeat], across[repeat]),
                    "along_mm": along[repeat],
                    "across_mm": across[repeat],
                    "delta_s_mm": along[repeat],
                    "delta_heading_deg": heading[repeat],
                    "heading_deg": heading[repeat],
                    "rotation_deg": abs(math.degrees((TARGETS | OTHERS)[trajectory][2])) + heading[repeat],
                }
                for repeat in range(repeats)
            ]
    return pd.DataFrame(rows)
