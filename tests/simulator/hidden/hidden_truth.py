"""An independent truth for hidden plants: thesis eq. 5.6 to 5.8 in the thesis' own form, by an adaptive integrator."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from agvbench.simulator.hidden import SealedTruth
from agvbench.simulator.hidden.plant import HiddenPlant

LF, LR = 0.181, 0.121
FULL_MPS = 5.6e-4 * 570.0  # the base vehicle's line at full command, 30 µs of dead band
HALF_MPS = 5.6e-4 * 270.0
SLOPE = -1.4e-3  # rad per µs
START = (0.3, -0.2, 0.7)
EDGE = 1e-12  # s: to stay on one side of a break


def quiet(turnaround_s=15.0, changes=(), **constants):
    """A plant of the default base vehicle without play."""
    truth = SealedTruth("nothing", changes=tuple(changes))
    return HiddenPlant(constants, (0.0, 0.0, 0.0), 0, truth, turnaround_s=turnaround_s)


def pulse(angle_rad):
    return 1500.0 + angle_rad / SLOPE


def poses(plant, rows, start=START, dt=0.02):
    """Poses after every `dt` of rows (duration, drive share, front angle, rear angle)."""
    plant.reset(start, seed=1)
    return np.array(
        [
            plant.advance(1500.0 - 600.0 * share, pulse(front), pulse(rear), dt)
            for duration, share, front, rear in rows
            for _ in range(round(duration / dt))
        ]
    )


def motion(front, rear, v_front, v_rear, bend=lambda curvature, speed: curvature, axles=(LF, LR)):
    """Speed, sideslip and yaw rate; `bend` changes the path's curvature."""
    lf, lr = axles
    sideslip = math.atan((lr * math.tan(front) + lf * math.tan(rear)) / (lf + lr))
    speed = (v_front * math.cos(front) + v_rear * math.cos(rear)) / (2.0 * math.cos(sideslip))
    curvature = math.cos(sideslip) * (math.tan(front) - math.tan(rear)) / (lf + lr)
    return speed, sideslip, speed * bend(curvature, speed)


def integrate(
    ends,
    front,
    rear,
    speed,
    *,
    ratio=1.0,
    bend=lambda c, v: c,
    extra=lambda v: (0.0, 0.0),
    loss=None,
    axles=(LF, LR),
    start=START,
    dt=0.02,
):
    """Poses every `dt`; ``front(t)``, ``rear(t)``, ``speed(t)`` are smooth between the `ends` [s]."""

    def rates(t, pose):
        f, r, w = front(t), rear(t), speed(t)
        if loss is not None:
            w *= loss(pose, f, r)
        v, sideslip, yaw = motion(f, r, w, ratio * w, bend, axles)
        x, y = extra(v)
        return [v * math.cos(pose[2] + sideslip) + x, v * math.sin(pose[2] + sideslip) + y, yaw]

    pose, begin, rows = np.array(start), 0.0, []
    for end in ends:
        times = begin + dt * np.arange(1, round((end - begin) / dt) + 1)
        found = solve_ivp(
            lambda t, p, a=begin, b=end: rates(min(max(t, a + EDGE), b - EDGE), p), (begin, times[-1] + 1e-9), pose,
            t_eval=times, rtol=1e-10, atol=1e-12, max_step=0.05,
        )  # fmt: skip
        rows.append(found.y.T)
        pose, begin = found.y[:, -1], end
    return np.concatenate(rows)
