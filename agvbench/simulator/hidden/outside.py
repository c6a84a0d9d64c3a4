"""Recipes of causes that the library does not have: the honest answer is UNKNOWN, with what it depends on."""

from __future__ import annotations

import math

from agvbench.simulator.hidden.library import renamed
from agvbench.simulator.hidden.recipe import Recipe, Size

_DEG = math.pi / 180.0
_TURN = Size(-math.pi, math.pi, grows=0)
_POSITION = ("x_m", "y_m")


def _outside(
    name: str, covariates: tuple[str, ...], sizes: dict[str, Size], random_phase: bool = False, /, **names: str
) -> Recipe:
    return Recipe(
        name, None, "outside", sizes, renamed(**names), covariates=covariates, random_phase=random_phase
    )  # fmt: skip


OUTSIDE = (
    _outside(  # a disc of soft or dirty floor
        "slow_patch", _POSITION,
        {
            "loss": Size(0.10, 0.30), "x_m": Size(0.4, 0.9, signed=True, grows=0),
            "y_m": Size(0.0, 0.3, signed=True, grows=0),
            "radius_m": Size(0.30, 0.50, grows=0),
        },
        patch_loss="loss", patch_x="x_m", patch_y="y_m", patch_radius="radius_m",
    ),
    _outside(  # a joint between plates turns the vehicle
        "floor_seam", _POSITION,
        {
            "kick_rad": Size(1.0 * _DEG, 3.0 * _DEG, signed=True),
            "place_m": Size(0.2, 0.7, signed=True, grows=0), "direction_rad": Size(-0.4, 0.4, grows=0),
        },
        seam_kick="kick_rad", seam_place="place_m", seam_direction="direction_rad",
    ),
    _outside(  # carpet: against the nap it drives slower
        "floor_nap", ("heading_rad",), {"share": Size(0.02, 0.06), "direction_rad": _TURN},
        nap="share", nap_direction="direction_rad",
    ),
    _outside(  # an eccentric left wheel: speed and course swing once per turn
        "wheel_runout", ("distance_modulo_period_m",),
        {"share": Size(0.04, 0.10), "period_m": Size(0.25, 0.60, grows=0), "phase_rad": _TURN}, True,
        runout="share", runout_period="period_m", runout_phase="phase_rad",
    ),
    _outside(  # a servo amplifier that turns further as it warms
        "servo_warm_up", ("campaign_time_h",),
        {"gain": Size(0.04, 0.10, signed=True), "time_constant_h": Size(0.2, 0.6, grows=0)},
        warm_gain="gain", warm_hours="time_constant_h",
    ),
    _outside(  # the motor loses speed while it drives, and recovers at rest
        "speed_sag", ("time_in_run_s",),
        {"share": Size(0.04, 0.10), "time_constant_s": Size(2.0, 5.0, grows=0)}, sag="share", sag_s="time_constant_s",
    ),
    _outside(  # one axle breaks loose before the other: no progress, but a twist
        "stick_slip", ("time_in_run_s", "history"),
        {"twist_rad": Size(0.8 * _DEG, 2.5 * _DEG, signed=True), "duration_s": Size(0.05, 0.15, grows=0)},
        stick_twist="twist_rad", stick_s="duration_s",
    ),
    _outside(  # a servo stops short of where it is sent, by a share of the way
        "servo_hysteresis", ("history", "curvature_per_m"), {"share": Size(0.05, 0.12)}, shortfall="share",
    ),
    _outside(  # the drive's torque turns the front wheels one way ahead, the other way back
        "torque_steer", ("direction",), {"angle_rad": Size(0.6 * _DEG, 2.0 * _DEG, signed=True)},
        torque_steer="angle_rad",
    ),
    _outside(  # barrel or pincushion: the camera's scale changes with the distance from the middle of the room
        "lens_distortion", _POSITION, {"per_m2": Size(0.006, 0.02, signed=True)}, lens="per_m2",
    ),
)  # fmt: skip
