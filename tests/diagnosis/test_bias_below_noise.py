"""A bias that rates of change do not show above the noise of poses, and that bends whole runs."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from tiny_selector import selector_of

from agvbench.campaign import CampaignHeader
from agvbench.diagnosis.discrepancy.stepwise import add_term
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.types import NO_TARGET, Commands, Frames, Run
from agvbench.vehicle.channels import Channels

HEADER = CampaignHeader(
    schema=3, name="bent", vehicle_name="bent", front_axle_m=0.0, rear_axle_m=0.05, channels=Channels.alike("si"),
    mocap_rate_hz=50.0, kinematics="differential",
)  # fmt: skip
CURVATURE_PER_M = -0.03
"""Forward and backward to the same side: one motor is weaker in one direction."""
BEGINS_S, DRIVEN_S, SEEN_S = 0.5, 4.0, 5.0


def driven(speed: float, yaw_rate: float, curvature_per_m: float, rng: np.random.Generator) -> Frames:
    """Return frames of a drive that begins and ends at once, in closed form; speeds scatter by 1 % between runs."""
    t = np.arange(0.0, SEEN_S, 0.02)
    moved_s = np.clip(t - BEGINS_S, 0.0, DRIVEN_S)
    speed, yaw_rate = (value * (1.0 + 0.01 * rng.normal()) for value in (speed, yaw_rate))
    turn = yaw_rate + curvature_per_m * abs(speed)
    start = rng.uniform(-math.pi, math.pi)
    heading = start + turn * moved_s
    along = speed * moved_s * np.sinc(0.5 * turn * moved_s / math.pi)  # the chord
    x, y = along * np.cos(0.5 * (start + heading)), along * np.sin(0.5 * (start + heading))
    x, y = x + 0.05 * np.cos(heading), y + 0.05 * np.sin(heading)
    noisy = np.column_stack([x, y, heading]) + rng.normal(size=(len(t), 3)) * [3e-4, 3e-4, 6e-3]
    noisy[:, 2] = (noisy[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    nan = np.full(len(t), np.nan)
    return Frames(t, *noisy.T, np.ones(len(t), dtype=bool), np.arange(len(t)), nan, nan)


def campaign(curvature_per_m: float) -> list[Run]:
    rng = np.random.default_rng(3)
    levels = [*product((-0.3, -0.15, 0.15, 0.3), (0.0, -0.5, 0.5)), (0.0, 0.6), (0.0, -0.6)]
    runs = []
    for repeat, (k, (speed, yaw_rate)) in product((1, 2, 3), enumerate(levels)):
        commands = Commands(
            BEGINS_S + np.array([-BEGINS_S, 0.0, DRIVEN_S]),
            np.array([0.0, speed, 0.0]),
            np.array([0.0, yaw_rate, 0.0]),
            np.zeros(3),
        )
        runs.append(
            Run(
                f"{k}-r{repeat}", "drive", "", "calibrated", repeat, NO_TARGET, 60.0 * len(runs), "ok", "bent",
                commands, driven(speed, yaw_rate, curvature_per_m, rng),
            )
        )  # fmt: skip
    return runs


@pytest.mark.parametrize("curvature_per_m", [CURVATURE_PER_M, 0.0])
def test_the_poses_decide_where_rates_show_nothing(curvature_per_m):
    selector = selector_of(campaign(curvature_per_m), HEADER)
    base = selector.base()
    found = add_term(Selection(base, base, {}, {}, {}, selector.models_fitted), selector)
    if not curvature_per_m:
        assert found is None
        return
    assert [one.term.name for one in found.terms] == ["turn_by_direction"]
    assert found.terms[0].values(found.selection.chosen)["curvature_per_m"] == pytest.approx(curvature_per_m, abs=0.003)


def test_a_run_that_only_turns_on_the_spot_starts_where_it_stood_before_it_turned():
    runs = campaign(0.0)
    starts = selector_of(runs, HEADER).batch.readings.start
    for run, (_, _, heading) in zip(runs, starts, strict=True):
        first = float(np.median(np.unwrap(run.frames.heading_rad)[: int(BEGINS_S / 0.02)]))
        assert math.remainder(heading - first, 2.0 * math.pi) == pytest.approx(0.0, abs=0.005)
