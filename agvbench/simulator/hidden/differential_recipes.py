"""What differential vehicles alone may hide, and what they hide in another way than steered axles do."""

from __future__ import annotations

import math

from agvbench.simulator.hidden.recipe import (
    STEP,
    Recipe,
    Size,
    Values,
    changing_cause,
    library_effect,
    of_differential,
    outside_cause,
)

_DEG = math.pi / 180.0


def _of_wheels(values: Values) -> Values:
    """Return the constants of a lag that both wheels have: speed and yaw rate are their sum and difference."""
    lag = values["time_constant_s"]
    return {"lag_s": lag, "accelerate_s": lag, "brake_s": lag}


def _of_second_order(values: Values) -> Values:
    frequency, damping = values["frequency_rad_per_s"], values["damping"]
    return {
        "servo_frequency": frequency, "servo_damping": damping, "drive_frequency": frequency, "drive_damping": damping
    }  # fmt: skip


DIFFERENTIAL = of_differential(
    Recipe("wheel_lag", "wheel_lag", "library", {"time_constant_s": Size(0.10, 0.30)}, _of_wheels),
    library_effect(
        "yaw_acceleration_limit", {"acceleration_radps2": Size(1.0, 3.0, grows=-1)}, slew="acceleration_radps2"
    ),
    library_effect(  # tyres scrub, and the controller of the yaw rate has an integral part
        "turning_resistance", {"friction_radps": Size(0.10, 0.30), "integral_time_s": Size(1.0, 4.0, grows=0)},
        scrub="friction_radps", scrub_integral_s="integral_time_s",
    ),
    library_effect(
        "drive_dead_band", {"width": Size(0.03, 0.08)}, True, {"drive_dead": 0.0}, dead_width="width"
    ),
    library_effect(  # no map of a yaw rate absorbs it: at neutral the vehicle does not turn
        "wheel_diameter_mismatch", {"curvature_per_m": Size(0.03, 0.10, signed=True)},
        wheel_curvature="curvature_per_m",
    ),
    library_effect(  # nor this: no such vehicle moves to its side
        "heading_misalignment", {"angle_rad": Size(1.0 * _DEG, 3.0 * _DEG, signed=True)}, turned="angle_rad",
    ),
    Recipe(  # speed controllers with integral action: order two
        "wheel_lag_second_order", "wheel_lag", "other form",
        {"frequency_rad_per_s": Size(8.0, 16.0, grows=-1), "damping": Size(0.7, 1.0, grows=0)}, _of_second_order,
    ),
    Recipe(  # both motors lose speed, so that turns become slower as well
        "battery_droop_of_wheels", "battery_droop", "other form", {"per_hour": Size(0.03, 0.10)},
        lambda values: {"droop": values["per_hour"], "turn_droop": values["per_hour"]},
    ),
    outside_cause(  # one motor is weaker backward: the course bends to the same side forward and backward
        "motor_asymmetry", ("direction",), {"curvature_per_m": Size(0.03, 0.10, signed=True)},
        course_curvature="curvature_per_m",
    ),
    outside_cause(  # the caster comes about when the vehicle leaves in another direction than it came
        "caster_swivel", ("time_in_run_s", "history", "direction"),
        {"kick_rad": Size(2.0 * _DEG, 6.0 * _DEG, signed=True), "trail_m": Size(0.015, 0.03, grows=0)},
        caster_kick="kick_rad", caster_trail="trail_m",
    ),
    outside_cause(  # tyres warm up and scrub less: turns become wider or narrower
        "tyre_warm_up", ("campaign_time_h",),
        {"gain": Size(0.04, 0.10, signed=True), "time_constant_h": Size(0.2, 0.6, grows=0)},
        warm_gain="gain", warm_hours="time_constant_h",
    ),
    changing_cause(  # a tyre loses air
        "tyre_pressure_step", ("wheel_curvature",), {"curvature_per_m": Size(0.02, 0.06, signed=True)} | STEP,
        wheel_curvature="curvature_per_m",
    ),
)  # fmt: skip
