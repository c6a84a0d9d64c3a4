"""One step of the simulation, within which all quantities are smooth.

The motion is evaluated at the four Gauss–Legendre nodes; heading and position follow by collocation (Hairer, Nørsett
and Wanner 1993, section II.7). A part of the kernel; see `agvbench.model.simulation.compose`.
"""

from __future__ import annotations

import math

from agvbench.effects.state import (
    COS_FRONT,
    COS_REAR,
    DISTANCE,
    DRAGGED,
    FORWARD,
    FRONT,
    FRONT_SPEED,
    HEADING,
    HOURS,
    KNOWN_FRONT,
    KNOWN_REAR,
    LEFT,
    REAR,
    REAR_SPEED,
    ROLLED,
    SPEED,
    TAN_FRONT,
    TAN_REAR,
    TIME,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators.plan import actuate
from agvbench.model.simulation.layout import (
    ALONG_X,
    ALONG_Y,
    COUNT,
    DIFFERENTIAL,
    FRONT_AXLE,
    FRONT_DRIVE_SHARE,
    LATERAL,
    LONGITUDINAL,
    NODES,
    REAR_AXLE,
    SECONDS_PER_HOUR,
    START_ROLLED,
    STARTED,
    TO_NODES,
    TURN,
    TURNED,
    WEIGHTS,
)
from agvbench.model.simulation.stages import drift, drive, move, steer
from agvbench.model.simulation.trigonometry import cosine_and_sine
from agvbench.types import Floats


@compiled(inner=True, fast=True)
def set_motion(s: Floats, p: Floats, vehicle: Floats) -> None:
    """Turn angles and speed in `s` into the body's motion (thesis eq. 5.6–5.8, corrected).

    The front value of a differential vehicle is its yaw rate.
    """
    steer(s, p)
    if vehicle[DIFFERENTIAL] != 0.0:
        s[FRONT_SPEED] = s[REAR_SPEED] = s[SPEED]
        s[COS_FRONT] = s[COS_REAR] = s[DRAGGED] = 1.0
        s[TAN_FRONT] = s[TAN_REAR] = 0.0
        drive(s, p)
        # What slips and what differs left and right acts at the axle, and the centroid turns with it.
        s[FORWARD], s[LEFT], s[YAW_RATE] = s[FRONT_SPEED], 0.0, s[FRONT]
        move(s, p)
        s[LEFT] += vehicle[REAR_AXLE] * s[YAW_RATE]
        return
    front, rear = s[FRONT], s[REAR]
    if front != s[KNOWN_FRONT]:
        cosine, sine = cosine_and_sine(front)
        s[KNOWN_FRONT], s[COS_FRONT], s[TAN_FRONT] = front, cosine, sine / cosine
    if rear != s[KNOWN_REAR]:
        cosine, sine = cosine_and_sine(rear)
        s[KNOWN_REAR], s[COS_REAR], s[TAN_REAR] = rear, cosine, sine / cosine
    s[FRONT_SPEED] = s[REAR_SPEED] = s[SPEED]
    s[DRAGGED] = 1.0
    drive(s, p)
    front_axle_m, rear_axle_m, share = vehicle[FRONT_AXLE], vehicle[REAR_AXLE], vehicle[FRONT_DRIVE_SHARE]
    forward = share * s[FRONT_SPEED] * s[COS_FRONT] + (1.0 - share) * s[REAR_SPEED] * s[COS_REAR]
    per_wheelbase = forward / (front_axle_m + rear_axle_m)
    s[FORWARD] = forward
    s[LEFT] = per_wheelbase * (front_axle_m * s[TAN_REAR] + rear_axle_m * s[TAN_FRONT])
    s[YAW_RATE] = per_wheelbase * (s[TAN_FRONT] - s[TAN_REAR])
    move(s, p)


@compiled(inner=True, fast=True)
def take_step(
    s: Floats, p: Floats, plan: Floats, work: Floats, vehicle: Floats, begin: float, tau: float, length: float,
    start: Floats,
) -> None:  # fmt: skip
    """Fill `work` for a step of `length` from `tau` after `begin`; `start` is the pose there and the distance."""
    x_rate, y_rate, yaw_rate = s[X_RATE], s[Y_RATE], s[YAW_RATE]
    for i in range(COUNT):
        elapsed = NODES[i] * length
        actuate(plan, tau + elapsed, s)
        s[TIME] = begin + tau + elapsed
        s[HOURS] = vehicle[STARTED] + s[TIME] / SECONDS_PER_HOUR
        # Pose for effects that depend on it, extrapolated with the velocity at the last node.
        s[X], s[Y], s[HEADING] = start[0] + elapsed * x_rate, start[1] + elapsed * y_rate, start[2] + elapsed * yaw_rate
        s[DISTANCE] = start[3] + elapsed * abs(s[SPEED])
        s[ROLLED] = start[START_ROLLED] + elapsed * s[SPEED]
        set_motion(s, p, vehicle)
        work[LONGITUDINAL + i], work[LATERAL + i], work[TURN + i] = s[FORWARD], s[LEFT], s[YAW_RATE]
    start_cosine, start_sine = math.cos(start[2]), math.sin(start[2])
    for i in range(COUNT):
        turned = 0.0
        for j in range(COUNT):
            turned += length * TO_NODES[i, j] * work[TURN + j]
        # The heading by the formulas of a sum of angles: little is turned within a step.
        cosine_turned, sine_turned = cosine_and_sine(turned)
        cosine = start_cosine * cosine_turned - start_sine * sine_turned
        sine = start_sine * cosine_turned + start_cosine * sine_turned
        s[HEADING] = start[2] + turned
        s[FORWARD], s[LEFT], s[YAW_RATE] = work[LONGITUDINAL + i], work[LATERAL + i], work[TURN + i]
        s[X_RATE] = cosine * s[FORWARD] - sine * s[LEFT]
        s[Y_RATE] = sine * s[FORWARD] + cosine * s[LEFT]
        drift(s, p)
        work[ALONG_X + i], work[ALONG_Y + i], work[TURNED + i] = s[X_RATE], s[Y_RATE], s[YAW_RATE]


@compiled(inner=True, fast=True)
def end_step(work: Floats, start: Floats, length: float) -> None:
    """Move `start`, pose and distances, to the end of the step."""
    driven = rolled = 0.0
    for j in range(COUNT):
        weight = WEIGHTS[j] * length
        start[0] += weight * work[ALONG_X + j]
        start[1] += weight * work[ALONG_Y + j]
        start[2] += weight * work[TURNED + j]
        driven += weight * abs(work[LONGITUDINAL + j])
        rolled += weight * work[LONGITUDINAL + j]
    start[3] += driven
    start[START_ROLLED] += rolled
