"""An independent truth for laws of another order: their equations as one prints them, integrated by DOP853."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from simulation_truth import LF, LR, REST, RUN_TIMES, SETTLED

from agvbench.types import Floats

_TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
Path = Callable[[float], float]


AXLES = ("front", "rear")


def at_once(values: Floats, moments: Floats) -> Path:
    """Return the path of what jumps to `values` at `moments`; `values` begins with where it was before."""
    steps, levels = moments.tolist(), values.tolist()
    return lambda t: levels[bisect.bisect_right(steps, t)]


def joined(begins: list[float], pieces: Sequence[Path]) -> Path:
    """Return the path whose pieces begin at `begins`, and which stands before."""
    return lambda t: pieces[max(0, bisect.bisect_right(begins, t) - 1)](max(t, begins[0]))


def _first(solution: Any, t: float) -> float:
    return float(solution(t)[0])


def second_order(aim: Path, rest: float, moments: Floats, lag: float, tau: float, end: float) -> Path:
    """Return the path of a servo with inertia: tau² δ̈ + lag δ̇ = aim − δ."""

    def equation(aimed: float) -> Callable[[float, Floats], list[float]]:
        return lambda _, y: [y[1], (aimed - y[0] - lag * y[1]) / tau**2]

    return _pieces(equation, aim, np.array([rest, 0.0]), moments, end)


def first_order(aim: Path, rest: float, moments: Floats, lag: float, end: float) -> Path:
    """Return the path of a servo without inertia: lag δ̇ = aim − δ."""
    return _pieces(lambda aimed: lambda _, y: [(aimed - y[0]) / lag], aim, np.array([rest]), moments, end)


def limited(aim: Path, rest: float, moments: Floats, rate: float, acceleration: float, end: float) -> Path:
    """Return the path of a servo that speeds up until it has its rate or must brake, and stops on its aim."""
    times, states = [moments[0]], [np.array([rest, 0.0])]
    push = []
    for begin, until in zip(moments, [*moments[1:], end], strict=True):
        aimed, now, y = aim(begin + 1e-9), begin, states[-1]
        while now < until - 1e-12:
            stop = y[0] + y[1] * abs(y[1]) / (2.0 * acceleration)
            ahead = math.copysign(1.0, aimed - stop)
            if abs(aimed - y[0]) + abs(y[1]) < 1e-7:
                pushed, done = 0.0, []
            elif abs(aimed - stop) < 1e-9:
                pushed, done = -math.copysign(acceleration, y[1]), [lambda _, z: z[1]]
            elif ahead * y[1] > rate - 1e-9:
                pushed, done = 0.0, [lambda _, z: z[0] + z[1] * abs(z[1]) / (2.0 * acceleration) - aimed]  # noqa: B023
            else:
                pushed = ahead * acceleration
                done = [
                    lambda _, z: z[0] + z[1] * abs(z[1]) / (2.0 * acceleration) - aimed,  # noqa: B023
                    lambda _, z: ahead * z[1] - rate,  # noqa: B023
                ]
            for event in done:
                event.terminal = True  # type: ignore[attr-defined]
            found = solve_ivp(lambda _, z: [z[1], pushed], (now, until), y, events=done, **_TIGHT)  # noqa: B023
            push.append(pushed)
            now, y = found.t[-1], found.y[:, -1]
            if pushed != 0.0 and abs(aimed - y[0]) + abs(y[1]) < 1e-7:
                y = np.array([aimed, 0.0])
            times.append(now)
            states.append(y)
    return lambda t: _parabola(t, times, states, push)


def turned(aim: Path, rest: float, moments: Floats, left: float, right: float, end: float) -> Path:
    """Return the path of a servo that turns to the left and to the right at rates of its own."""
    times, angles = [moments[0]], [rest]
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        aimed = float(aim(begin + 1e-9))
        rate = left if aimed > angles[-1] else right
        there = begin + abs(aimed - angles[-1]) / rate
        if there < until:
            times.append(there)
            angles.append(aimed)
        times.append(until)
        angles.append(
            angles[-1] + math.copysign(rate * (until - times[-2]), aimed - angles[-1]) if there >= until else aimed
        )
    known, values = np.array(times), np.array(angles)
    return lambda t: float(np.interp(t, known, values))


def taken_up(aim: Path, rest: float, moments: Floats, lags: Floats, end: float) -> Path:
    """Return the path of a first-order lag that has another time constant (n,) under each command."""
    pieces, was = [], rest
    for begin, until, lag in zip(moments.tolist(), [*moments[1:].tolist(), end], lags.tolist(), strict=True):
        aimed = float(aim(begin + 1e-9))
        piece = partial(
            lambda t, at, was, to, lag: to + (was - to) * math.exp((at - t) / lag), at=begin, was=was, to=aimed, lag=lag
        )
        pieces.append(piece)
        was = piece(until)
    return joined(moments.tolist(), pieces)


def _parabola(t: float, times: list[float], states: list[Floats], push: list[float]) -> float:
    i = max(0, min(bisect.bisect_right(times, t) - 1, len(push) - 1))
    since = max(0.0, t - times[i])
    return float(states[i][0] + states[i][1] * since + 0.5 * push[i] * since**2)


def ramped(aim: Path, moments: Floats, speeding: float, braking: float, end: float) -> Path:
    """Return the path of a speed that ramps, from rest."""
    times, speeds = [moments[0]], [0.0]
    for begin, until in zip(moments, [*moments[1:], end], strict=True):
        aimed, now = aim(begin + 1e-9), begin
        while now < until:
            v = speeds[-1]
            grows = v * aimed >= 0.0 and abs(aimed) > abs(v)
            to = 0.0 if v * aimed < 0.0 else aimed
            slope = speeding if grows else braking
            now = min(until, now + abs(to - v) / slope) if to != v else until
            done = abs(to - v) <= slope * (now - times[-1]) + 1e-12
            speeds.append(to if done else v + math.copysign(slope * (now - times[-1]), to - v))
            times.append(now)
    moments, known = np.array(times), np.array(speeds)
    return lambda t: float(np.interp(t, moments, known))


def body_share(front: Path, rear: Path) -> Path:
    """Return the body's longitudinal speed over that of the drive: the mean of what both axles have along the body."""
    return lambda t: 0.5 * (math.cos(front(t)) + math.cos(rear(t)))


def ramped_up(aim: Path, share: Path, moments: Floats, speeding_mps2: float, brake_s: float, end: float) -> Path:
    """Return the path of a speed that ramps while it grows and decays exponentially while it falls, from rest.

    The body, which has this `share` of the speed, ramps at `speeding_mps2`.
    """
    begins, pieces, v = [], [], 0.0
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        aimed, now = float(aim(begin + 1e-9)), begin
        speeding = speeding_mps2 / share(begin + 1e-9)
        while now < until:
            falls = v * aimed < 0.0 or abs(aimed) < abs(v)
            if falls:
                piece = partial(
                    lambda t, at, was, to: to + (was - to) * math.exp((at - t) / brake_s), at=now, was=v, to=aimed
                )
                stops = now + brake_s * math.log((v - aimed) / -aimed) if v * aimed < 0.0 else math.inf
            else:
                slope = math.copysign(speeding, aimed - v) if aimed != v else 0.0
                piece = partial(lambda t, at, was, by: was + by * (t - at), at=now, was=v, by=slope)
                stops = now + abs(aimed - v) / speeding if aimed != v else math.inf
            begins.append(now)
            pieces.append(piece)
            now = min(until, stops)
            v = (0.0 if falls else aimed) if now == stops else piece(now)
    return joined(begins, pieces)


def rubbed(aim: Path, moments: Floats, values: dict[str, float], end: float) -> Path:
    """Return the path of a speed with lags, which falls to zero no faster than dry friction lets it, from rest."""
    rise_s, fall_s, friction_mps2 = (values[name] for name in ("accelerate_s", "brake_s", "coast_mps2"))

    def decayed(t: float, at: float, was: float, to: float, lag_s: float) -> float:
        return to + (was - to) * math.exp((at - t) / lag_s)

    begins, pieces, v = [], [], 0.0
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        aimed, now = float(aim(begin + 1e-9)), begin
        while now < until:
            falls = v * aimed < 0.0 or abs(aimed) < abs(v)
            piece = partial(decayed, at=now, was=v, to=aimed, lag_s=fall_s if falls else rise_s)
            stops, then = (now + fall_s * math.log((v - aimed) / -aimed), 0.0) if v * aimed < 0.0 else (math.inf, aimed)
            if aimed == 0.0 and abs(v) > friction_mps2 * fall_s + 1e-12:
                slope = -math.copysign(friction_mps2, v)
                piece = partial(lambda t, at, was, by: was + by * (t - at), at=now, was=v, by=slope)
                stops, then = now + abs(v) / friction_mps2 - fall_s, -slope * fall_s
            begins.append(now)
            pieces.append(piece)
            now = min(until, stops)
            v = then if now == stops else piece(now)
    return joined(begins, pieces)


def coasted(aim: Path, share: Path, moments: Floats, ramp_mps2: float, coast_s: float, end: float) -> Path:
    """Return the path of a speed that ramps to a powered level and decays exponentially to zero, from rest.

    The body, which has this `share` of the speed, ramps at `ramp_mps2`.
    """
    pieces, v = [], 0.0
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        aimed, acceleration = float(aim(begin + 1e-9)), ramp_mps2 / share(begin + 1e-9)
        if aimed == 0.0:
            piece = partial(lambda t, at, was: was * math.exp((at - t) / coast_s), at=begin, was=v)
        else:
            piece = partial(
                lambda t, at, was, to, by: was + math.copysign(min(abs(to - was), by * (t - at)), to - was),
                at=begin, was=v, to=aimed, by=acceleration,
            )  # fmt: skip
        pieces.append(piece)
        v = piece(until)
    return joined(moments.tolist(), pieces)


def held_back(aim: Path, share: Path, moments: Floats, values: dict[str, float], end: float) -> Path:
    """Return the path of a speed with a lag under power, whose body accelerates no more than a limit, from rest."""

    def slope(_: float, v: Floats, aimed: float, most: float) -> Floats:
        if aimed == 0.0:
            return -v / values["coast_s"]
        return np.asarray(np.clip((aimed - v) / values["powered_s"], -most, most))

    pieces, v = [], np.zeros(1)
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        given = float(aim(begin + 1e-9)), values["acceleration_mps2"] / share(begin + 1e-9)
        found = solve_ivp(slope, (begin, until), v, args=given, dense_output=True, max_step=0.01, **_TIGHT)
        pieces.append(partial(_first, found.sol))
        v = found.y[:, -1]
    return joined(moments.tolist(), pieces)


def sprung(aim: Path, share: Path, moments: Floats, values: dict[str, float], end: float) -> Path:
    """Return the path of a speed that obeys a limited motor, and without power friction and a relaxing spring.

    The motor limits the acceleration of the body, which has this `share` of the speed.
    """

    def equation(aimed: float) -> Callable[[float, Floats], list[float]]:
        def slopes(_: float, y: Floats) -> list[float]:
            v, w = y
            if aimed != 0.0:
                return [0.0, -w / values["relaxation_s"]]  # the speed under power has a closed form
            return [-v / values["coast_s"] - values["spring_per_s2"] * w, v - w / values["relaxation_s"]]

        return slopes

    pieces, state = [], np.zeros(2)
    for begin, until in zip(moments.tolist(), [*moments[1:].tolist(), end], strict=True):
        aimed = float(aim(begin + 1e-9))
        found = solve_ivp(equation(aimed), (begin, until), state, dense_output=True, **_TIGHT)
        limit = values["forward_mps2" if aimed > 0.0 else "backward_mps2"] / share(begin + 1e-9)
        piece = partial(_sprung_speed, found.sol, aimed, begin, state[0], limit, values.get("lag_s", 0.0))
        pieces.append(piece)
        state = np.array([piece(until), found.y[1, -1]])
    return joined(moments.tolist(), pieces)


def _sprung_speed(
    sol: Any, aimed: float, begin: float, was: float, acceleration: float, lag_s: float, t: float
) -> float:
    if aimed == 0.0:
        return float(sol(t)[0])
    short, since = abs(aimed - was), t - begin
    ramp_s = max(0.0, short / acceleration - lag_s)
    left = short - acceleration * min(since, ramp_s)
    if since > ramp_s:
        left *= math.exp((ramp_s - since) / lag_s) if lag_s > 0.0 else 0.0
    return aimed - math.copysign(left, aimed - was)


def backlash_closes(moments: Floats, speeds: Floats, backlash_m: float) -> tuple[Floats, list[int]]:
    """Return when commands move the wheels, and which do, by turning the motor through the backlash in small steps.

    ``moments`` (n,) of commands, ``speeds`` (n,) of the wheels; the vehicle is at rest before the first. A command that
    another replaces before the backlash is closed moves nothing.
    """
    times, moving, left = [], [], backlash_m
    for row, (begin, until, speed) in enumerate(zip(moments, [*moments[1:], math.inf], speeds, strict=True)):
        now, left = begin, left if speed != 0.0 else 0.0
        while left > 1e-12 and now < until:
            step = min(1e-5, left / abs(speed), until - now)
            now, left = now + step, left - abs(speed) * step
        if left <= 1e-12:
            times.append(now)
            moving.append(row)
        left = backlash_m if speed == 0.0 else left
    return np.array(times), moving


def _pieces(equation: Any, aim: Path, state: Floats, moments: Floats, end: float) -> Path:
    pieces = []
    for begin, until in zip(moments, [*moments[1:], end], strict=True):
        found = solve_ivp(equation(aim(begin + 1e-9)), (begin, until), state, dense_output=True, **_TIGHT)
        pieces.append(partial(_first, found.sol))
        state = found.y[:, -1]
    return joined(moments.tolist(), pieces)


def drive(
    front: Path, rear: Path, speed: Path, start: Floats, times: Floats, kinks: Floats, smoothing: float
) -> Floats:
    """Return (n, 3) poses at `times`, from `start` (3,), smoothed if asked for."""

    def motion(t: float, y: Floats) -> list[float]:
        df, dr, v = front(t), rear(t), speed(t)
        beta = math.atan((LF * math.tan(dr) + LR * math.tan(df)) / (LF + LR))
        along = v * (math.cos(df) + math.cos(dr)) / (2.0 * math.cos(beta))
        turn = along * math.cos(beta) * (math.tan(df) - math.tan(dr)) / (LF + LR)
        true = [along * math.cos(y[2] + beta), along * math.sin(y[2] + beta), turn]
        late = (y[:3] - y[3:]) / smoothing if smoothing > 0.0 else np.zeros(3)
        return [*true, *late]

    state, out = np.r_[start, start], np.tile(start, (len(times), 1))
    column = slice(3, 6) if smoothing > 0.0 else slice(0, 3)
    edges = np.unique(np.r_[kinks, times[-1] + 1.0])
    for begin, until in pairwise(edges.tolist()):
        found = solve_ivp(motion, (begin, until), state, dense_output=True, max_step=0.05, rtol=1e-7, atol=1e-9, method="DOP853")  # fmt: skip  # noqa: E501
        inside = (times > begin) & (times <= until)
        out[inside] = found.sol(times[inside])[column].T
        state = found.y[:, -1]
    return out


def aims(channel: int, moments: Floats) -> Path:
    """Return where channel 0 (front), 1 (rear) or 2 (speed) is to settle, its commands arriving at `moments`."""
    rest = [*REST, 0.0][channel]
    return at_once(np.r_[rest, SETTLED[:, channel]], moments)


def servo_path(name: str, values: dict[str, float], channel: int, moments: Floats, end: float) -> Path:
    """Return the path of a servo of second order, channel 0 (front) or 1 (rear)."""
    aim, rest = aims(channel, moments), REST[channel]
    if name in ("steering_lag_inertia", "steering_lag_uneven"):
        ratio = values.get("rear_ratio", 1.0) if channel == 1 else 1.0
        lag, inertia = ratio * values["time_constant_s"], ratio * values["inertia_s"]
        return (
            second_order(aim, rest, moments, lag, inertia, end)
            if inertia
            else first_order(aim, rest, moments, lag, end)
        )
    return limited(aim, rest, moments, values["rate_rad_per_s"], values["acceleration_rad_per_s2"], end)


def with_play(servo: Path, rest: float, width: float, end: float) -> Path:
    """Return the path of an axle behind a play, by following its servo in small steps."""
    times = np.arange(0.0, end, 1e-3)
    angles, angle = [], rest
    for position in map(servo, times):
        angle = min(max(angle, position - width / 2.0), position + width / 2.0)
        angles.append(angle)
    followed = np.array(angles)
    return lambda t: float(np.interp(t, times, followed))


def jumps_with_play(channel: int, width: float) -> Path:
    """Return the path of an axle behind a play whose servo, channel 0 (front) or 1 (rear), obeys at once."""
    angles = [float(REST[channel])]
    for position in SETTLED[:, channel].tolist():
        angles.append(min(max(angles[-1], position - width / 2.0), position + width / 2.0))
    return at_once(np.array(angles), RUN_TIMES)


def true_form(name: str, values: dict[str, float], start: tuple[float, float, float], times: Floats) -> Floats:
    """Return (n, 3) measured poses with one law."""
    end = times[-1] + 2.0
    late = {"front_s": values.get("steering_s", 0.0), "rear_s": values.get("steering_s", 0.0), **values}
    fronts, rears, drives = (RUN_TIMES + late.get(f"{channel}_s", 0.0) for channel in ("front", "rear", "drive"))
    front, rear, speed = aims(0, fronts), aims(1, rears), aims(2, drives)
    share = body_share(front, rear)
    if name in ("steering_lag_inertia", "steering_lag_uneven", "steering_rate_limit_acceleration"):
        front, rear = (servo_path(name, values, channel, RUN_TIMES, end) for channel in (0, 1))
    if name == "steering_rate_limit_sides":
        rate, ratio = values["rate_rad_per_s"], values["right_ratio"]
        front, rear = (turned(aims(k, RUN_TIMES), REST[k], RUN_TIMES, rate, ratio * rate, end) for k in (0, 1))
    if name == "steering_lag_distance":
        lags = values["length_m"] / np.maximum(np.abs(SETTLED[:, 2]), 1e-3)
        front, rear = (taken_up(aims(k, RUN_TIMES), REST[k], RUN_TIMES, lags, end) for k in (0, 1))
    if name == "steering_backlash_uneven":
        front, rear = (jumps_with_play(channel, values[f"{axle}_width_rad"]) for channel, axle in enumerate(AXLES))
    if name == "speed_lag_ramp":
        speed = ramped(speed, drives, values["acceleration_mps2"], values["braking_mps2"], end)
    if name in ("speed_lag_ramp_up", "speed_lag_coasting"):
        law = ramped_up if name == "speed_lag_ramp_up" else coasted
        speed = law(speed, share, drives, *values.values(), end)
    if name == "speed_lag_limited":
        speed = held_back(speed, share, drives, values, end)
    if name == "speed_lag_friction":
        speed = rubbed(speed, drives, values, end)
    if name == "speed_lag_inertia":
        speed = second_order(speed, 0.0, drives, values["time_constant_s"], values["inertia_s"], end)
    if name == "speed_lag_controller":
        powered = second_order(speed, 0.0, drives, values["time_constant_s"], values["inertia_s"], end)
        stops, coast_s = float(drives[-1]), values["coast_s"]
        speed = lambda t: powered(t) if t < stops else powered(stops) * math.exp((stops - t) / coast_s)  # noqa: E731
    if name == "speed_lag_motor":
        rates = 1.0 / values["powered_s"] + values["damping_per_m"] * np.abs(SETTLED[:, 2])
        lags = np.where(SETTLED[:, 2] == 0.0, values["coast_s"], 1.0 / rates)
        speed = taken_up(speed, 0.0, drives, lags, end)
    if name == "speed_lag_spring_back":
        drives, _ = backlash_closes(drives, SETTLED[:, 2], values.get("backlash_m", 0.0))
        speed = sprung(aims(2, drives), share, np.union1d(drives, RUN_TIMES), values, end)
    smoothing = values.get("time_constant_s", 0.0) if name == "mocap_latency_smoothing" else 0.0
    seen = times - values.get("latency_s", 0.0)
    return drive(front, rear, speed, np.array(start), seen, np.r_[fronts, rears, drives], smoothing)
