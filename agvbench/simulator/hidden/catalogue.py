"""Every effect that a plant may hide, by name: the library's, other forms of them, and causes outside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from agvbench.errors import OneOf, PlantError
from agvbench.simulator.hidden.recipe import Constants, Recipe, Size, Values

_DEG = math.pi / 180.0
_TURN = Size(-math.pi, math.pi, grows=0)


def renamed(**names: str) -> Constants:
    """Return a map of parameters to constants: ``renamed(lag_s="time_constant_s")``."""

    def constants(values: Values) -> Values:
        return {constant: values[parameter] for constant, parameter in names.items()}

    return constants


def _library(
    name: str, sizes: dict[str, Size], absorbed: bool = False, base: Values | None = None, /, **names: str
) -> Recipe:  # fmt: skip
    return Recipe(name, name, "library", sizes, renamed(**names), base or {}, absorbed=absorbed)


_NO_STOPS = {"front_low": -9.0, "front_high": 9.0, "rear_low": -9.0, "rear_high": 9.0}

LIBRARY = (
    _library("actuation_delay", {"delay_s": Size(0.06, 0.20)}, delay_s="delay_s"),
    _library("steering_lag", {"time_constant_s": Size(0.10, 0.35)}, lag_s="time_constant_s"),
    _library("steering_rate_limit", {"rate_rad_per_s": Size(0.6, 1.8, grows=-1)}, slew="rate_rad_per_s"),
    _library("steering_backlash", {"width_rad": Size(1.5 * _DEG, 4.0 * _DEG, most=8.0 * _DEG)}, backlash="width_rad"),
    _library(
        "steering_saturation",
        {"front_rad": Size(18.0 * _DEG, 28.0 * _DEG, grows=-1), "rear_rad": Size(18.0 * _DEG, 28.0 * _DEG, grows=-1)},
        True, _NO_STOPS, limit_front="front_rad", limit_rear="rear_rad",
    ),
    _library(
        "axle_coupling",
        {"front_from_rear": Size(0.03, 0.10, signed=True), "rear_from_front": Size(0.03, 0.10, signed=True)},
        front_from_rear="front_from_rear", rear_from_front="rear_from_front",
    ),
    _library("reverse_steering_gain", {"gain": Size(0.04, 0.12, signed=True)}, reverse_gain="gain"),
    _library(
        "speed_lag", {"accelerate_s": Size(0.12, 0.40), "brake_s": Size(0.08, 0.30)},
        accelerate_s="accelerate_s", brake_s="brake_s",
    ),
    _library("drive_dead_band", {"width": Size(60.0, 150.0)}, True, {"drive_dead": 0.0}, dead_width="width"),
    _library("cornering_speed_loss", {"loss": Size(0.04, 0.12)}, loss_tangent="loss"),
    _library("battery_droop", {"per_hour": Size(0.03, 0.10)}, droop="per_hour"),
    _library("lateral_slip", {"gradient": Size(0.6, 2.0)}, slip_square="gradient"),
    _library(
        "wheel_diameter_mismatch", {"curvature_per_m": Size(0.03, 0.10, signed=True)}, True,
        None, wheel_curvature="curvature_per_m",
    ),
    _library("axle_speed_mismatch", {"ratio": Size(0.08, 0.20, signed=True, most=0.30)}, axle_ratio="ratio"),
    _library("axle_overrun", {"excess": Size(1.5, 4.0)}, overrun="excess"),
    _library(
        "floor_tilt", {"drift_mps": Size(0.004, 0.012), "direction_rad": _TURN},
        drift="drift_mps", drift_direction="direction_rad",
    ),
    _library("mocap_latency", {"latency_s": Size(0.06, 0.20)}, latency_s="latency_s"),
    _library(
        "marker_offset", {"forward_m": Size(0.008, 0.025, signed=True), "left_m": Size(0.008, 0.025, signed=True)},
        marker_forward="forward_m", marker_left="left_m",
    ),
    _library(
        "heading_misalignment", {"angle_rad": Size(1.0 * _DEG, 3.0 * _DEG, signed=True)}, True,
        None, turned="angle_rad",
    ),
    _library("mocap_scale", {"scale": Size(0.01, 0.04, signed=True)}, True, None, scale="scale"),
)  # fmt: skip


def _other(name: str, library_name: str, sizes: dict[str, Size], /, **names: str) -> Recipe:
    return Recipe(name, library_name, "other form", sizes, renamed(**names))


OTHER_VARIANTS = (
    _other(  # the drive answers later than the servos, or sooner
        "actuation_delay_uneven", "actuation_delay",
        {"delay_s": Size(0.08, 0.20), "drive_share": Size(0.6, 0.8, grows=0)},
        delay_s="delay_s", drive_delay_share="drive_share",
    ),
    _other(  # a servo's inertia: order two
        "steering_lag_second_order", "steering_lag",
        {"frequency_rad_per_s": Size(6.0, 14.0, grows=-1), "damping": Size(0.8, 1.2, grows=0)},
        servo_frequency="frequency_rad_per_s", servo_damping="damping",
    ),
    _other(  # the servo has to get up to its rate, and down again
        "steering_rate_limit_accelerated", "steering_rate_limit",
        {"rate_rad_per_s": Size(0.6, 1.5, grows=-1), "acceleration_rad_per_s2": Size(8.0, 20.0, grows=0)},
        slew="rate_rad_per_s", slew_acceleration="acceleration_rad_per_s2",
    ),
    _other(  # constant acceleration (thesis 8.1), not an exponential
        "speed_lag_ramp", "speed_lag", {"acceleration_mps2": Size(0.4, 1.0, grows=-1)}, ramp="acceleration_mps2",
    ),
    _other(  # the square of the angle, not the tangent
        "cornering_speed_loss_square", "cornering_speed_loss", {"loss_per_rad2": Size(0.12, 0.35)},
        loss_square="loss_per_rad2",
    ),
    _other(  # falls fast, then slowly
        "battery_droop_exponential", "battery_droop",
        {"share": Size(0.04, 0.12), "time_constant_h": Size(0.5, 1.2, grows=0)},
        fade="share", fade_hours="time_constant_h",
    ),
    _other(  # as if grip fell with the speed, not with its square
        "lateral_slip_linear", "lateral_slip", {"gradient_s_per_m": Size(0.20, 0.6)}, slip_linear="gradient_s_per_m",
    ),
    _other(  # a faster vehicle drifts faster
        "floor_tilt_proportional", "floor_tilt", {"share": Size(0.015, 0.04), "direction_rad": _TURN},
        drift_share="share", drift_direction="direction_rad",
    ),
    _other(  # the tracker smooths instead of waiting
        "mocap_latency_smoothed", "mocap_latency", {"time_constant_s": Size(0.06, 0.20)},
        smoothing_s="time_constant_s",
    ),
)  # fmt: skip


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
    _outside(  # an eccentric left wheel: speed and course oscillate once per turn
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
    _outside(  # the drive's torque turns the front wheels one way forward, the other way backward
        "torque_steer", ("direction",), {"angle_rad": Size(0.6 * _DEG, 2.0 * _DEG, signed=True)},
        torque_steer="angle_rad",
    ),
    _outside(  # barrel or pincushion: the camera's scale changes with the distance from the middle of the room
        "lens_distortion", _POSITION, {"per_m2": Size(0.006, 0.02, signed=True)}, lens="per_m2",
    ),
)  # fmt: skip


_AT_ONCE_H = 1e-9
_STEP = {"begins_h": Size(0.3, 0.8, grows=0)}
_BY_CAMPAIGN_TIME = ("campaign_time_h",)


def _changing(
    name: str, changes: tuple[str, ...], sizes: dict[str, Size], fixed: Values | None = None, /, **names: str
) -> Recipe:
    constants = renamed(**names)
    return Recipe(
        name, None, "outside", sizes, lambda values: constants(values) | (fixed or {}),
        covariates=_BY_CAMPAIGN_TIME, changes=changes,
    )  # fmt: skip


CHANGING = (
    _changing(  # a servo linkage wears: it turns less and less
        "steering_gain_fade", ("warm_gain",),
        {"gain": Size(0.05, 0.12, signed=True), "time_constant_h": Size(0.3, 1.5, grows=0)}, {"warm_hours": _AT_ONCE_H},
        warm_gain="gain",
    ),
    _changing(  # the front servo's horn slips by a tooth
        "steering_trim_step", ("front_trim",), {"angle_rad": Size(0.8 * _DEG, 2.5 * _DEG, signed=True)} | _STEP,
        front_trim="angle_rad",
    ),
    _changing(  # the markers are bumped
        "marker_bump", ("turned", "marker_forward", "marker_left"),
        {
            "angle_rad": Size(0.6 * _DEG, 2.0 * _DEG, signed=True), "forward_m": Size(0.005, 0.02, signed=True),
            "left_m": Size(0.005, 0.02, signed=True),
        } | _STEP,
        turned="angle_rad", marker_forward="forward_m", marker_left="left_m",
    ),
    _changing(  # a fan blows for a part of the evening
        "wind_in_a_part", ("drift",),
        {"drift_mps": Size(0.002, 0.006), "direction_rad": _TURN, "ends_h": Size(0.8, 1.4, grows=0)} | _STEP,
        drift="drift_mps", drift_direction="direction_rad",
    ),
    _changing(  # a fresh battery, or an emptier one
        "battery_change", ("fade",), {"loss": Size(0.04, 0.10, signed=True)} | _STEP, {"fade_hours": _AT_ONCE_H},
        fade="loss",
    ),
    _changing(  # the camera's clock falls behind that of the commands
        "clock_drift", ("latency_s",), {"latency_s": Size(0.10, 0.30), "time_constant_h": Size(1.0, 3.0, grows=0)},
        latency_s="latency_s",
    ),
)  # fmt: skip


# Effects of the library that came later: `make_plant` does not draw them, so that its seeds keep their plants.
LATER = (_library("wheelbase_error", {"longer": Size(0.01, 0.04, signed=True)}, True, None, longer="longer"),)


CATALOGUE: Mapping[str, Recipe] = MappingProxyType(
    {r.name: r for r in (*LIBRARY, *OTHER_VARIANTS, *OUTSIDE, *CHANGING, *LATER)}
)
NOTHING = "nothing"
AND = "_and_"


def recipes(spec: str) -> tuple[Recipe, ...]:
    """Return what a specification hides: ``"nothing"``, a name, or two as ``"steering_lag_and_lateral_slip"``.

    Raises
    ------
    PlantError
        If a name is unknown, or an effect is named twice.

    Examples
    --------
    >>> [recipe.name for recipe in recipes("steering_lag_and_slow_patch")]
    ['steering_lag', 'slow_patch']
    """
    if spec == NOTHING:
        return ()
    names = spec.split(AND)
    unknown = next((name for name in names if name not in CATALOGUE), None)
    if unknown is not None or len(set(names)) < len(names):
        raise PlantError(
            "no such hidden effect" if unknown is not None else "an effect is hidden twice", value=unknown or spec,
            limit=OneOf([NOTHING, *CATALOGUE, f"two joined by {AND}"]),
            remedy="choose one, or add its recipe and equation to agvbench/simulator/hidden",
        )  # fmt: skip
    return tuple(CATALOGUE[name] for name in names)
