"""Recipes with the library's own equations: the names, parameters and signs that a diagnosis reports."""

from __future__ import annotations

import math

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
