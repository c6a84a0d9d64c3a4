"""Campaigns on disk with a known truth, driven by a formula instead of a vehicle."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.model import thesis_vehicle
from agvbench.types import NO_TARGET, Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

EIGHT = {
    "1_forward": (2.0, 0.0, 0.0),
    "2_backward": (-2.0, 0.0, 0.0),
    "3_forward_half_speed": (2.0, 0.0, 0.0),
    "4_backward_half_speed": (-2.0, 0.0, 0.0),
    "5_forward_left": (1.0, 1.0, math.pi / 2),
    "6_forward_right": (1.0, -1.0, -math.pi / 2),
    "7_backward_left": (-1.0, 1.0, -math.pi / 2),
    "8_backward_right": (-1.0, -1.0, math.pi / 2),
}
# Along [m], heading [rad] and their scatter: about what the thesis measured.
ERRORS = {"uncalibrated": (0.07, 0.09, 0.012, 0.02), "calibrated": (0.008, 0.02, 0.006, 0.012)}
HOSTILE = "<script>alert(1)</script> & $\\frac{1}{0}$ | \x1b[31m \u202e 漢字 =1+1"
MOVE_S, REST_S = 6.0, 0.6


def driven(target, error, rng, *, rate_hz=120.0, noise_m=3e-4):
    """Return frames of a run from a start on the floor to `target` plus `error` (along, heading)."""
    t = np.arange(-REST_S, MOVE_S + REST_S, 1.0 / rate_hz)
    share = np.clip(t / MOVE_S, 0.0, 1.0)
    along, turn = error
    reach = 1.0 + along / math.hypot(*target[:2])
    heading = share * (target[2] + turn)
    if target[2]:
        r = abs(target[0]) * reach
        angle = share * math.pi / 2
        x, y = math.copysign(1, target[0]) * r * np.sin(angle), math.copysign(1, target[1]) * r * (1 - np.cos(angle))
    else:
        x, y = share * target[0] * reach, share * target[0] * reach * np.tan(turn / 2)
    start = Pose(1.0 + 0.02 * rng.normal(), -0.5 + 0.02 * rng.normal(), 0.4)
    c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
    n = len(t)
    px = start.x_m + c * x - s * y + noise_m * rng.normal(size=n)
    py = start.y_m + s * x + c * y + noise_m * rng.normal(size=n)
    h = start.heading_rad + heading + 2e-3 * rng.normal(size=n)
    tracked = rng.random(n) > 0.01
    px[rng.random(n) < 0.003] += 3.0
    for column in (px, py, h):
        column[~tracked] = np.nan
    return Frames(t, px, py, h, tracked, np.arange(n), np.full(n, 4e-4), t + 0.01)


def make_campaign(
    path,
    *,
    repeats=3,
    trajectories=tuple(EIGHT),
    conditions=("uncalibrated", "calibrated"),
    name="Tonight",
    rename=None,
    calibration=True,
    rate_hz=120.0,
    seed=0,
    extra_mm=0.0,
    session=None,
):
    """Write a campaign in which every trajectory was driven `repeats` times under every condition; return its path."""
    rng = np.random.default_rng(seed)
    header = CampaignHeader(1, name, "thesis AGV", 0.181, 0.121, Channels.alike("us"), 120.0)
    writer = CampaignWriter.create(path, header, durable=False)
    commands = Commands(np.array([0.0, MOVE_S]), np.array([900.0, 1500.0]), np.full(2, 1500.0), np.full(2, 1500.0))
    started = 0.0
    for repeat in range(repeats):
        for trajectory in trajectories:
            for condition in conditions:
                if "half" in trajectory and condition == "uncalibrated":
                    continue
                along, turn, sd_m, sd_rad = ERRORS.get(condition, ERRORS["calibrated"])
                error = along + extra_mm / 1e3 + sd_m * rng.normal(), turn + sd_rad * rng.normal()
                rejected = repeat == 0 and trajectory.startswith("5") and condition == "calibrated"
                writer.append(
                    Run(
                        run_id=f"r{started:.0f}",
                        experiment="trajectory",
                        trajectory=rename or trajectory,
                        condition=rename or condition,
                        repeat=repeat,
                        target=Pose(*EIGHT[trajectory]),
                        started_s=started,
                        status="rejected: gap of 0.40 s without pose (limit: 0.25 s)" if rejected else "ok",
                        firmware="sim 1.0",
                        commands=commands,
                        frames=driven(EIGHT[trajectory], error, rng, rate_hz=rate_hz),
                        session=session,
                    )
                )
                started += 10.0
    if calibration:
        add_calibration(writer, rng)
    facts = {"git_revision": "abc123", "host": "lab"}
    writer.write_table("provenance", pd.DataFrame({"name": list(facts), "value": list(facts.values())}))
    return path


def add_calibration(writer, rng):
    """Write measurements around the thesis' vehicle, with its model."""
    model = thesis_vehicle()
    rows = []
    for axle in ("front", "rear", "drive"):
        for command in np.arange(900.0, 2101.0, 100.0):
            scale, sd = (1.0, 0.003) if axle == "drive" else (math.degrees(1.0), 0.15)
            value = scale * float(getattr(model, axle)(command)) + sd * rng.normal()
            rows.append((axle, command, value, sd, "c", bool(command in (900.0, 2100.0))))
    columns = ["axle", "command", "value", "stderr", "run_id", "left_out"]
    writer.write_table("calibration", pd.DataFrame(rows, columns=columns))
    model.save(writer.path / "vehicle.toml")


def make_free_campaign(path, *, runs=2):
    """Write a campaign of free drives: no run has a target."""
    rng = np.random.default_rng(1)
    header = CampaignHeader(1, "Free", "car", 0.1, 0.1, Channels.alike("normalised"), 120.0)
    writer = CampaignWriter.create(path, header, durable=False)
    commands = Commands(np.array([0.0]), np.array([0.3]), np.array([0.1]), np.array([0.0]))
    for index in range(runs):
        writer.append(
            Run(
                run_id=f"free{index}",
                experiment="free",
                trajectory="",
                condition="",
                repeat=0,
                target=NO_TARGET,
                started_s=10.0 * index,
                status="ok",
                firmware="",
                commands=commands,
                frames=driven((2.0, 0.0, 0.0), (0.0, 0.1), rng),
            )
        )
    return path
