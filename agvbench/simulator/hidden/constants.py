"""What a hidden plant is made of, as one vector: the base vehicle's constants, then every mechanism that may be hidden.

Each mechanism has a null at which it does nothing, bit for bit: a base plant is the vector with all nulls.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.types import Floats

BASE: dict[str, float] = {
    "neutral": 1500.0, "command_low": 900.0, "command_high": 2100.0,
    "front_slope": -1.4e-3, "front_offset": 0.0, "front_low": -0.7, "front_high": 0.7,
    "rear_slope": -1.4e-3, "rear_offset": 0.0, "rear_low": -0.7, "rear_high": 0.7,
    "drive_dead": 30.0, "gain_forward": 5.6e-4, "gain_backward": 5.6e-4,
    "front_axle": 0.181, "rear_axle": 0.121,
}  # fmt: skip
"""The base vehicle: two lines with end stops [rad/µs, rad], a dead band [µs], a line [m/s per µs], two axles [m]."""

NULL: dict[str, float] = {
    # transport
    "delay_s": 0.0, "drive_delay_share": 1.0,
    # servos
    "lag_s": 0.0, "servo_frequency": 0.0, "servo_damping": 1.0, "slew": math.inf, "slew_acceleration": math.inf,
    "backlash": 0.0, "shortfall": 0.0, "limit_front": math.inf, "limit_rear": math.inf,
    # linkage
    "front_from_rear": 0.0, "rear_from_front": 0.0, "reverse_gain": 0.0, "torque_steer": 0.0,
    "warm_gain": 0.0, "warm_hours": 1.0,
    # drive
    "accelerate_s": 0.0, "brake_s": 0.0, "ramp": math.inf, "dead_width": 0.0, "droop": 0.0,
    "fade": 0.0, "fade_hours": 1.0, "sag": 0.0, "sag_s": 1.0, "stick_s": 0.0, "stick_twist": 0.0,
    # wheels and body
    "loss_tangent": 0.0, "loss_square": 0.0, "axle_ratio": 0.0, "slip_square": 0.0, "slip_linear": 0.0,
    "wheel_curvature": 0.0, "runout": 0.0, "runout_period": 1.0, "runout_phase": 0.0, "runout_track": 0.16,
    # floor
    "drift": 0.0, "drift_share": 0.0, "drift_direction": 0.0, "patch_loss": 0.0, "patch_x": 0.0, "patch_y": 0.0,
    "patch_radius": 0.0, "seam_kick": 0.0, "seam_place": 0.0, "seam_direction": 0.0, "nap": 0.0, "nap_direction": 0.0,
    # camera
    "latency_s": 0.0, "smoothing_s": 0.0, "marker_forward": 0.0, "marker_left": 0.0, "turned": 0.0, "scale": 0.0,
    "lens": 0.0,
    # wheels, again: what is added comes last, because compiled code keeps the places that it was compiled with
    "overrun": 0.0, "front_trim": 0.0, "longer": 0.0,
    # differential vehicles: the front servo is the yaw rate's controller, and the rear one does nothing
    "differential": 0.0, "drive_sign": -1.0, "track": 0.3, "turn_droop": 0.0, "drive_frequency": 0.0,
    "drive_damping": 1.0, "course_curvature": 0.0, "caster_kick": 0.0, "caster_trail": 0.02,
    # two axles, again
    "shared_by_differential": 0.0,
    # differential vehicles, again
    "scrub": 0.0, "scrub_integral_s": 1.0,
}  # fmt: skip
"""Every mechanism's constants at their null."""

NAMES = (*BASE, *NULL)

# Where they lie in the vector, in the order of NAMES (a test compares).
(
    NEUTRAL, COMMAND_LOW, COMMAND_HIGH,
    FRONT_SLOPE, FRONT_OFFSET, FRONT_LOW, FRONT_HIGH, REAR_SLOPE, REAR_OFFSET, REAR_LOW, REAR_HIGH,
    DRIVE_DEAD, GAIN_FORWARD, GAIN_BACKWARD, FRONT_AXLE, REAR_AXLE,
    DELAY_S, DRIVE_DELAY_SHARE,
    LAG_S, SERVO_FREQUENCY, SERVO_DAMPING, SLEW, SLEW_ACCELERATION, BACKLASH, SHORTFALL, LIMIT_FRONT, LIMIT_REAR,
    FRONT_FROM_REAR, REAR_FROM_FRONT, REVERSE_GAIN, TORQUE_STEER, WARM_GAIN, WARM_HOURS,
    ACCELERATE_S, BRAKE_S, RAMP, DEAD_WIDTH, DROOP, FADE, FADE_HOURS, SAG, SAG_S, STICK_S, STICK_TWIST,
    LOSS_TANGENT, LOSS_SQUARE, AXLE_RATIO, SLIP_SQUARE, SLIP_LINEAR, WHEEL_CURVATURE,
    RUNOUT, RUNOUT_PERIOD, RUNOUT_PHASE, RUNOUT_TRACK,
    DRIFT, DRIFT_SHARE, DRIFT_DIRECTION, PATCH_LOSS, PATCH_X, PATCH_Y, PATCH_RADIUS,
    SEAM_KICK, SEAM_PLACE, SEAM_DIRECTION, NAP, NAP_DIRECTION,
    LATENCY_S, SMOOTHING_S, MARKER_FORWARD, MARKER_LEFT, TURNED, SCALE, LENS,
    OVERRUN, FRONT_TRIM, LONGER,
    DIFFERENTIAL, DRIVE_SIGN, TRACK, TURN_DROOP, DRIVE_FREQUENCY, DRIVE_DAMPING, COURSE_CURVATURE,
    CASTER_KICK, CASTER_TRAIL,
    SHARED_BY_DIFFERENTIAL,
    SCRUB, SCRUB_INTEGRAL_S,
) = range(len(NAMES))  # fmt: skip


def pack(values: dict[str, float]) -> Floats:
    """Return the vector with `values` set and all else at base or null.

    Raises
    ------
    KeyError
        If a name is unknown.

    Examples
    --------
    >>> float(pack({"lag_s": 0.2})[LAG_S])
    0.2
    """
    unknown = set(values) - set(NAMES)
    if unknown:
        raise KeyError(f"no such constants: {', '.join(sorted(unknown))}")
    return np.array([float((BASE | NULL | values)[name]) for name in NAMES])
