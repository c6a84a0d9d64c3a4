"""An independent truth for simulations: every effect's equation written out in one place, integrated by DOP853."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from agvbench.types import Floats

LF, LR = 0.181, 0.121

#: Sizes that show clearly in `RUN_TIMES`' drive.
SIZES: Mapping[str, Mapping[str, float]] = {
    "actuation_delay": {"delay_s": 0.07},
    "steering_lag": {"time_constant_s": 0.15},
    "steering_rate_limit": {"rate_rad_per_s": 1.5},
    "steering_backlash": {"width_rad": 0.06},
    "steering_saturation": {"front_rad": 0.3, "rear_rad": 0.25},
    "axle_coupling": {"front_from_rear": 0.08, "rear_from_front": -0.05},
    "reverse_steering_gain": {"gain": 0.1},
    "speed_lag": {"accelerate_s": 0.3, "brake_s": 0.2},
    "drive_dead_band": {"width": 40.0},
    "cornering_speed_loss": {"loss": 0.15},
    "battery_droop": {"per_hour": 0.2},
    "lateral_slip": {"gradient": 2.0},
    "wheel_diameter_mismatch": {"curvature_per_m": 0.05},
    "axle_speed_mismatch": {"ratio": 0.1},
    "axle_overrun": {"excess": 1.5},
    "axle_differential": {"share": 0.8},
    "floor_tilt": {"drift_mps": 0.01, "direction_rad": 0.8},
    "mocap_latency": {"latency_s": 0.06},
    "marker_offset": {"forward_m": 0.02, "left_m": -0.015},
    "heading_misalignment": {"angle_rad": 0.04},
    "mocap_scale": {"scale": 0.03},
    "wheelbase_error": {"longer": 0.05},
}

# Forward, steering changed on the way, backward at once, stop.
RUN_TIMES = np.array([0.0, 1.3, 2.21, 3.0, 4.4])
COMMANDS = np.array([[250.0, 1, 1], [250.0, 2, 2], [150.0, 3, 3], [-200.0, 4, 4], [0.0, 5, 5]])  # drive, from neutral
SETTLED = np.array([[0.35, -0.2, 0.25], [-0.3, 0.4, 0.25], [0.1, 0.3, 0.15], [0.4, -0.35, -0.2], [0.05, 0.02, 0.0]])
REST = (0.03, -0.02)
STARTED_H = 0.7
FRAMES = np.arange(-0.2, 6.0, 0.04)


def true_poses(sizes: Mapping[str, Mapping[str, float]], start: tuple[float, float, float]) -> Floats:
    """Return (n, 3) measured poses at `FRAMES` with the effects of `sizes`, the camera reporting `start` at first."""
    get = _Sizes(sizes)
    heading = start[2] - get("heading_misalignment", "angle_rad")
    scale = 1.0 + get("mocap_scale", "scale")
    ahead, left = get("marker_offset", "forward_m"), get("marker_offset", "left_m")
    c, s = math.cos(heading), math.sin(heading)
    state = np.array([start[0] / scale - c * ahead + s * left, start[1] / scale - s * ahead - c * left, heading])
    true = _integrate(get, np.concatenate([state, REST, [0.0]]), FRAMES - get("mocap_latency", "latency_s"))
    c, s = np.cos(true[:, 2]), np.sin(true[:, 2])
    return np.column_stack(
        [
            scale * (true[:, 0] + c * ahead - s * left),
            scale * (true[:, 1] + s * ahead + c * left),
            true[:, 2] + get("heading_misalignment", "angle_rad"),
        ]
    )


class _Sizes:
    def __init__(self, sizes: Mapping[str, Mapping[str, float]]) -> None:
        self.sizes = sizes

    def __call__(self, effect: str, parameter: str, null: float = 0.0) -> float:
        return self.sizes.get(effect, {}).get(parameter, null)


def _integrate(get: _Sizes, state: Floats, times: Floats) -> Floats:
    poses = np.tile(state[:3], (len(times), 1))
    begins = RUN_TIMES + get("actuation_delay", "delay_s")
    axles = np.array(REST)
    for i, begin in enumerate(begins):
        end = begins[i + 1] if i + 1 < len(begins) else times[-1] + 1.0
        aims = _aims(get, i)
        if get("steering_lag", "time_constant_s") == 0.0 and get("steering_rate_limit", "rate_rad_per_s") == 0.0:
            state[3:5] = aims[:2]
        if get("speed_lag", "accelerate_s") == 0.0:
            state[5] = aims[2]
        solution = solve_ivp(
            _equations(get, aims, axles, state[3:5], begin),
            (begin, end),
            state,
            method="DOP853",
            rtol=1e-9,
            atol=1e-10,
            dense_output=True,
            max_step=0.1,
        )
        inside = (times > begin) & (times <= end)
        poses[inside] = solution.sol(times[inside])[:3].T
        rate = get("steering_rate_limit", "rate_rad_per_s") * (end - begin)
        ramped = state[3:5] + np.clip(aims[:2] - state[3:5], -rate, rate)
        state = solution.y[:, -1].copy()
        if rate > 0.0 and get("steering_lag", "time_constant_s") == 0.0:
            state[3:5] = ramped
        half = get("steering_backlash", "width_rad") / 2.0
        axles = np.clip(axles, state[3:5] - half, state[3:5] + half)
        poses[times > end] = state[:3]
    return poses


def _aims(get: _Sizes, row: int) -> tuple[float, float, float]:
    front, rear, speed = SETTLED[row]
    front_limit = get("steering_saturation", "front_rad", math.inf)
    rear_limit = get("steering_saturation", "rear_rad", math.inf)
    width, command = get("drive_dead_band", "width"), abs(COMMANDS[row, 0])
    if command <= width:
        speed = 0.0
    elif width > 0.0:
        speed *= (command - width) / command
    return float(np.clip(front, -front_limit, front_limit)), float(np.clip(rear, -rear_limit, rear_limit)), float(speed)


def _balanced(along: list[float], drag: float, stiff: float) -> float:
    """Return the speed at which two axles that pull towards their own speed, or brake more stiffly, balance a drag."""
    sign, speeds = math.copysign(1.0, sum(along)), [abs(speed) for speed in along]

    def force(speed: float) -> float:
        pulls = [(own - speed) * (1.0 if own >= speed else stiff) for own in speeds]
        return sum(pulls) - drag * sum(speeds)

    return float(sign * brentq(force, min(speeds) - drag * sum(speeds) - 1e-3, max(speeds) + 1e-3, xtol=1e-13))


def _equations(get, aims, axles, servos, begin):  # type: ignore[no-untyped-def]
    lag, rate = get("steering_lag", "time_constant_s"), get("steering_rate_limit", "rate_rad_per_s")
    half = get("steering_backlash", "width_rad") / 2.0

    def servo_rate(gap: float) -> float:
        return 0.0 if lag == 0.0 else gap / lag if rate == 0.0 else max(-rate, min(rate, gap / lag))

    def servo(aim: float, begun: float, now: float, elapsed: float) -> float:
        if lag == 0.0 and rate > 0.0:  # Without a lag a limited servo goes straight and stops on its aim.
            return begun + max(-rate * elapsed, min(rate * elapsed, aim - begun))
        return now

    def right_hand_side(t: float, y: Floats) -> list[float]:
        _, _, heading, servo_front, servo_rear, v = y
        servo_front = servo(aims[0], servos[0], servo_front, t - begin)
        servo_rear = servo(aims[1], servos[1], servo_rear, t - begin)
        df = min(max(axles[0], servo_front - half), servo_front + half)
        dr = min(max(axles[1], servo_rear - half), servo_rear + half)
        df, dr = (
            df + get("axle_coupling", "front_from_rear") * dr,
            dr + get("axle_coupling", "rear_from_front") * df,
        )
        if v < 0.0:
            df, dr = (
                (1.0 + get("reverse_steering_gain", "gain")) * df,
                (1.0 + get("reverse_steering_gain", "gain")) * dr,
            )
        drag = get("cornering_speed_loss", "loss") * (abs(math.tan(df)) + abs(math.tan(dr)))
        vf = v * (1.0 - get("battery_droop", "per_hour") * (STARTED_H + t / 3600.0))
        vr = (1.0 + get("axle_speed_mismatch", "ratio")) * vf
        # Eq. 5.6–5.10 as printed, with the two corrections.
        longer = 0.5 * get("wheelbase_error", "longer") * (LF + LR)
        lf, lr = LF + longer, LR + longer
        beta = math.atan((lf * math.tan(dr) + lr * math.tan(df)) / (lf + lr))
        speed = _balanced([vf * math.cos(df), vr * math.cos(dr)], drag, 1.0 + get("axle_overrun", "excess"))
        middle = 2.0 / (1.0 / math.cos(df) + 1.0 / math.cos(dr))  # a differential keeps the mean of the wheels' speeds
        mean = (math.cos(df) + math.cos(dr)) / 2.0
        speed *= 1.0 + get("axle_differential", "share") * (middle / mean - 1.0)
        speed /= math.cos(beta)
        curvature = math.cos(beta) * (math.tan(df) - math.tan(dr)) / (lf + lr)
        # Effects of the body act in the order of the library: the wheelbase comes after slip and wheels.
        slipping = speed * math.cos(beta) * math.hypot(1.0, (LF * math.tan(dr) + LR * math.tan(df)) / (LF + LR))
        curvature /= 1.0 + get("lateral_slip", "gradient") * slipping**2
        curvature += get("wheel_diameter_mismatch", "curvature_per_m") / (1.0 + get("wheelbase_error", "longer"))
        drift = get("floor_tilt", "drift_mps") * (1.0 - math.exp(-((speed / 0.003) ** 2)))
        slope = get("floor_tilt", "direction_rad")
        growing = v * aims[2] >= 0.0 and abs(aims[2]) > abs(v)
        drive_lag = get("speed_lag", "accelerate_s" if growing else "brake_s")
        return [
            speed * math.cos(heading + beta) + drift * math.cos(slope),
            speed * math.sin(heading + beta) + drift * math.sin(slope),
            speed * curvature,
            servo_rate(aims[0] - servo_front),
            servo_rate(aims[1] - servo_rear),
            0.0 if drive_lag == 0.0 else (aims[2] - v) / drive_lag,
        ]

    return right_hand_side
