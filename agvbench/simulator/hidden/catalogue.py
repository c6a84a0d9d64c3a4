"""Every effect that a plant may hide, by name: the library's, other forms of them, and causes outside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import get_args

from agvbench.errors import OneOf, PlantError
from agvbench.simulator.hidden.differential_recipes import DIFFERENTIAL
from agvbench.simulator.hidden.recipe import (
    AT_ONCE_H,
    STEP,
    TURN,
    Recipe,
    Size,
    changing_cause,
    library_effect,
    of_either,
    other_form,
    outside_cause,
)
from agvbench.types import Kinematics

_DEG = math.pi / 180.0


_NO_STOPS = {"front_low": -9.0, "front_high": 9.0, "rear_low": -9.0, "rear_high": 9.0}

LIBRARY = (
    of_either(library_effect("actuation_delay", {"delay_s": Size(0.06, 0.20)}, delay_s="delay_s")),
    of_either(library_effect("steering_lag", {"time_constant_s": Size(0.10, 0.35)}, lag_s="time_constant_s")),
    library_effect("steering_rate_limit", {"rate_rad_per_s": Size(0.6, 1.8, grows=-1)}, slew="rate_rad_per_s"),
    library_effect(
        "steering_backlash", {"width_rad": Size(1.5 * _DEG, 4.0 * _DEG, most=8.0 * _DEG)},
        backlash="width_rad",
    ),
    library_effect(
        "steering_saturation",
        {"front_rad": Size(18.0 * _DEG, 28.0 * _DEG, grows=-1), "rear_rad": Size(18.0 * _DEG, 28.0 * _DEG, grows=-1)},
        True, _NO_STOPS, limit_front="front_rad", limit_rear="rear_rad",
    ),
    library_effect(
        "axle_coupling",
        {"front_from_rear": Size(0.03, 0.10, signed=True), "rear_from_front": Size(0.03, 0.10, signed=True)},
        front_from_rear="front_from_rear", rear_from_front="rear_from_front",
    ),
    library_effect("reverse_steering_gain", {"gain": Size(0.04, 0.12, signed=True)}, reverse_gain="gain"),
    of_either(library_effect(
        "speed_lag", {"accelerate_s": Size(0.12, 0.40), "brake_s": Size(0.08, 0.30)},
        accelerate_s="accelerate_s", brake_s="brake_s",
    )),
    library_effect("drive_dead_band", {"width": Size(60.0, 150.0)}, True, {"drive_dead": 0.0}, dead_width="width"),
    library_effect("cornering_speed_loss", {"loss": Size(0.04, 0.12)}, loss_tangent="loss"),
    of_either(library_effect("battery_droop", {"per_hour": Size(0.03, 0.10)}, droop="per_hour")),
    of_either(library_effect("lateral_slip", {"gradient": Size(0.6, 2.0)}, slip_square="gradient")),
    library_effect(
        "wheel_diameter_mismatch", {"curvature_per_m": Size(0.03, 0.10, signed=True)}, True,
        None, wheel_curvature="curvature_per_m",
    ),
    library_effect("axle_speed_mismatch", {"ratio": Size(0.08, 0.20, signed=True, most=0.30)}, axle_ratio="ratio"),
    library_effect("axle_overrun", {"excess": Size(1.5, 4.0)}, overrun="excess"),
    of_either(library_effect(
        "floor_tilt", {"drift_mps": Size(0.004, 0.012), "direction_rad": TURN},
        drift="drift_mps", drift_direction="direction_rad",
    )),
    of_either(library_effect("mocap_latency", {"latency_s": Size(0.06, 0.20)}, latency_s="latency_s")),
    of_either(library_effect(
        "marker_offset", {"forward_m": Size(0.008, 0.025, signed=True), "left_m": Size(0.008, 0.025, signed=True)},
        marker_forward="forward_m", marker_left="left_m",
    )),
    library_effect(
        "heading_misalignment", {"angle_rad": Size(1.0 * _DEG, 3.0 * _DEG, signed=True)}, True,
        None, turned="angle_rad",
    ),
    of_either(library_effect("mocap_scale", {"scale": Size(0.01, 0.04, signed=True)}, True, None, scale="scale")),
)  # fmt: skip


OTHER_VARIANTS = (
    other_form(  # the drive answers later than the servos, or sooner
        "actuation_delay_uneven", "actuation_delay",
        {"delay_s": Size(0.08, 0.20), "drive_share": Size(0.6, 0.8, grows=0)},
        delay_s="delay_s", drive_delay_share="drive_share",
    ),
    other_form(  # a servo's inertia: order two
        "steering_lag_second_order", "steering_lag",
        {"frequency_rad_per_s": Size(6.0, 14.0, grows=-1), "damping": Size(0.8, 1.2, grows=0)},
        servo_frequency="frequency_rad_per_s", servo_damping="damping",
    ),
    other_form(  # the servo has to get up to its rate, and down again
        "steering_rate_limit_accelerated", "steering_rate_limit",
        {"rate_rad_per_s": Size(0.6, 1.5, grows=-1), "acceleration_rad_per_s2": Size(8.0, 20.0, grows=0)},
        slew="rate_rad_per_s", slew_acceleration="acceleration_rad_per_s2",
    ),
    of_either(other_form(  # constant acceleration (thesis 8.1), not an exponential
        "speed_lag_ramp", "speed_lag", {"acceleration_mps2": Size(0.4, 1.0, grows=-1)}, ramp="acceleration_mps2",
    )),
    other_form(  # the square of the angle, not the tangent
        "cornering_speed_loss_square", "cornering_speed_loss", {"loss_per_rad2": Size(0.12, 0.35)},
        loss_square="loss_per_rad2",
    ),
    other_form(  # falls fast, then slowly
        "battery_droop_exponential", "battery_droop",
        {"share": Size(0.04, 0.12), "time_constant_h": Size(0.5, 1.2, grows=0)},
        fade="share", fade_hours="time_constant_h",
    ),
    of_either(other_form(  # as if grip fell with the speed, not with its square
        "lateral_slip_linear", "lateral_slip", {"gradient_s_per_m": Size(0.20, 0.6)}, slip_linear="gradient_s_per_m",
    )),
    of_either(other_form(  # a faster vehicle drifts faster
        "floor_tilt_proportional", "floor_tilt", {"share": Size(0.015, 0.04), "direction_rad": TURN},
        drift_share="share", drift_direction="direction_rad",
    )),
    of_either(other_form(  # the tracker smooths instead of waiting
        "mocap_latency_smoothed", "mocap_latency", {"time_constant_s": Size(0.06, 0.20)},
        smoothing_s="time_constant_s",
    )),
)  # fmt: skip


_POSITION = ("x_m", "y_m")


OUTSIDE = (
    of_either(outside_cause(  # a disc of soft or dirty floor
        "slow_patch", _POSITION,
        {
            "loss": Size(0.10, 0.30), "x_m": Size(0.4, 0.9, signed=True, grows=0),
            "y_m": Size(0.0, 0.3, signed=True, grows=0),
            "radius_m": Size(0.30, 0.50, grows=0),
        },
        patch_loss="loss", patch_x="x_m", patch_y="y_m", patch_radius="radius_m",
    )),
    of_either(outside_cause(  # a joint between plates turns the vehicle
        "floor_seam", _POSITION,
        {
            "kick_rad": Size(1.0 * _DEG, 3.0 * _DEG, signed=True),
            "place_m": Size(0.2, 0.7, signed=True, grows=0), "direction_rad": Size(-0.4, 0.4, grows=0),
        },
        seam_kick="kick_rad", seam_place="place_m", seam_direction="direction_rad",
    )),
    of_either(outside_cause(  # carpet: against the nap it drives slower
        "floor_nap", ("heading_rad",), {"share": Size(0.02, 0.06), "direction_rad": TURN},
        nap="share", nap_direction="direction_rad",
    )),
    of_either(outside_cause(  # an eccentric left wheel: speed and course oscillate once per turn
        "wheel_runout", ("distance_modulo_period_m",),
        {"share": Size(0.04, 0.10), "period_m": Size(0.25, 0.60, grows=0), "phase_rad": TURN}, True,
        runout="share", runout_period="period_m", runout_phase="phase_rad",
    )),
    outside_cause(  # a servo amplifier that turns further as it warms
        "servo_warm_up", ("campaign_time_h",),
        {"gain": Size(0.04, 0.10, signed=True), "time_constant_h": Size(0.2, 0.6, grows=0)},
        warm_gain="gain", warm_hours="time_constant_h",
    ),
    of_either(outside_cause(  # the motor loses speed while it drives, and recovers at rest
        "speed_sag", ("time_in_run_s",),
        {"share": Size(0.04, 0.10), "time_constant_s": Size(2.0, 5.0, grows=0)}, sag="share", sag_s="time_constant_s",
    )),
    of_either(outside_cause(  # one axle breaks loose before the other: no progress, but a twist
        "stick_slip", ("time_in_run_s", "history"),
        {"twist_rad": Size(0.8 * _DEG, 2.5 * _DEG, signed=True), "duration_s": Size(0.05, 0.15, grows=0)},
        stick_twist="twist_rad", stick_s="duration_s",
    )),
    outside_cause(  # a servo stops short of where it is sent, by a share of the way
        "servo_hysteresis", ("history", "curvature_per_m"), {"share": Size(0.05, 0.12)}, shortfall="share",
    ),
    outside_cause(  # the drive's torque turns the front wheels one way forward, the other way backward
        "torque_steer", ("direction",), {"angle_rad": Size(0.6 * _DEG, 2.0 * _DEG, signed=True)},
        torque_steer="angle_rad",
    ),
    of_either(outside_cause(  # barrel or pincushion: the scale changes with the distance from the room's middle
        "lens_distortion", _POSITION, {"per_m2": Size(0.006, 0.02, signed=True)}, lens="per_m2",
    )),
)  # fmt: skip


CHANGING = (
    changing_cause(  # a servo linkage wears: it turns less and less
        "steering_gain_fade", ("warm_gain",),
        {"gain": Size(0.05, 0.12, signed=True), "time_constant_h": Size(0.3, 1.5, grows=0)}, {"warm_hours": AT_ONCE_H},
        warm_gain="gain",
    ),
    changing_cause(  # the front servo's horn slips by a tooth
        "steering_trim_step", ("front_trim",), {"angle_rad": Size(0.8 * _DEG, 2.5 * _DEG, signed=True)} | STEP,
        front_trim="angle_rad",
    ),
    of_either(changing_cause(  # the markers are bumped
        "marker_bump", ("turned", "marker_forward", "marker_left"),
        {
            "angle_rad": Size(0.6 * _DEG, 2.0 * _DEG, signed=True), "forward_m": Size(0.005, 0.02, signed=True),
            "left_m": Size(0.005, 0.02, signed=True),
        } | STEP,
        turned="angle_rad", marker_forward="forward_m", marker_left="left_m",
    )),
    of_either(changing_cause(  # a fan blows for a part of the evening
        "wind_in_a_part", ("drift",),
        {"drift_mps": Size(0.002, 0.006), "direction_rad": TURN, "ends_h": Size(0.8, 1.4, grows=0)} | STEP,
        drift="drift_mps", drift_direction="direction_rad",
    )),
    of_either(changing_cause(  # a fresh battery, or an emptier one
        "battery_change", ("fade",), {"loss": Size(0.04, 0.10, signed=True)} | STEP, {"fade_hours": AT_ONCE_H},
        fade="loss",
    )),
    of_either(changing_cause(  # the camera's clock falls behind that of the commands
        "clock_drift", ("latency_s",), {"latency_s": Size(0.10, 0.30), "time_constant_h": Size(1.0, 3.0, grows=0)},
        latency_s="latency_s",
    )),
)  # fmt: skip


# Effects of the library that came later: `make_plant` does not draw them, so that its seeds keep their plants.
LATER = (
    library_effect("wheelbase_error", {"longer": Size(0.01, 0.04, signed=True)}, True, None, longer="longer"),
    library_effect("axle_differential", {"share": Size(0.9, 1.0, most=1.0)}, shared_by_differential="share"),
)


_RECIPES = (*LIBRARY, *OTHER_VARIANTS, *OUTSIDE, *CHANGING, *LATER, *DIFFERENTIAL)


def _of(kinematics: Kinematics) -> Mapping[str, Recipe]:
    return MappingProxyType({recipe.name: recipe for recipe in _RECIPES if kinematics in recipe.kinematics})


_CATALOGUES: Mapping[Kinematics, Mapping[str, Recipe]] = {kind: _of(kind) for kind in get_args(Kinematics)}
CATALOGUE = _CATALOGUES["two_axle"]


def catalogue(kinematics: Kinematics) -> Mapping[str, Recipe]:
    """Return everything that a vehicle of this kind may hide, by name."""
    return _CATALOGUES[kinematics]


def library(kinematics: Kinematics) -> tuple[Recipe, ...]:
    """Return the effects with the library's own equations that a vehicle of this kind may hide."""
    later = {recipe.name for recipe in LATER}
    return tuple(r for r in _CATALOGUES[kinematics].values() if r.kind == "library" and r.name not in later)


NOTHING = "nothing"
AND = "_and_"


def recipes(spec: str, kinematics: Kinematics = "two_axle") -> tuple[Recipe, ...]:
    """Return what a specification hides: ``"nothing"``, a name, or two as ``"steering_lag_and_lateral_slip"``.

    Raises
    ------
    PlantError
        If a name is unknown, a vehicle of this kind cannot have the effect, or an effect is named twice.

    Examples
    --------
    >>> [recipe.name for recipe in recipes("steering_lag_and_slow_patch")]
    ['steering_lag', 'slow_patch']
    """
    if spec == NOTHING:
        return ()
    names, known = spec.split(AND), catalogue(kinematics)
    unknown = next((name for name in names if name not in known), None)
    if unknown is not None or len(set(names)) < len(names):
        raise PlantError(
            "no such hidden effect" if unknown is not None else "an effect is hidden twice", value=unknown or spec,
            limit=OneOf([NOTHING, *known, f"two joined by {AND}"]),
            remedy="choose one, or add its recipe and equation to agvbench/simulator/hidden",
        )  # fmt: skip
    return tuple(known[name] for name in names)
