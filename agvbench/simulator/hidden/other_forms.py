"""Recipes of the library's causes in another order or form: the name should still be found."""

from __future__ import annotations

import math

from agvbench.simulator.hidden.library import renamed
from agvbench.simulator.hidden.recipe import Recipe, Size

_TURN = Size(-math.pi, math.pi, grows=0)


def _other(name: str, library_name: str, sizes: dict[str, Size], /, **names: str) -> Recipe:
    return Recipe(name, library_name, "other form", sizes, renamed(**names))


OTHER_FORMS = (
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
