"""What planned commands do to a vehicle, worked out independently: a rigid body with two axles, integrated by RK4.

Nothing here comes from agvbench but its record types. The body's velocity is the least-squares answer to "each axle's
centre moves along its wheels" taken with its own wheel speed, in the components in which eq. 5.6 takes them.
"""

import math

import numpy as np

FRONT_M, REAR_M = 0.181, 0.121


def nominal(drive, front, rear):
    """The uncalibrated vehicle: 45° per 600 µs, 0.32 m/s at full command, falling pulse = left and forward."""
    speed = 0.32 * (1500.0 - drive) / 600.0
    return math.radians(45.0) * (1500.0 - front) / 600.0, math.radians(45.0) * (1500.0 - rear) / 600.0, speed


def end_of(pieces, start):
    """Return the pose after all pieces of a path, driven one after another from `start`."""
    for piece in pieces:
        start = piece.end(start)
    return start


def body_rates(state, front, rear, speed):
    """Return ẋ, ẏ, ψ̇ from the two axle points: their lateral speeds are forward speed times the tangents."""
    forward = 0.5 * speed * (math.cos(front) + math.cos(rear))
    front_left, rear_left = forward * math.tan(front), forward * math.tan(rear)
    yaw_rate = (front_left - rear_left) / (FRONT_M + REAR_M)
    left = rear_left + REAR_M * yaw_rate
    c, s = math.cos(state[2]), math.sin(state[2])
    return np.array([forward * c - left * s, forward * s + left * c, yaw_rate])


def driven(commands, until_s, vehicle=nominal, steps_per_row=80):
    """Return the pose, from the origin, after driving `commands` for `until_s` seconds."""
    state = np.zeros(3)
    ends = [*commands.t_s[1:].tolist(), until_s]
    for row, end in enumerate(ends):
        angles = vehicle(commands.drive[row], commands.front[row], commands.rear[row])
        dt = (end - commands.t_s[row]) / steps_per_row
        for _ in range(steps_per_row if angles[2] and dt > 0.0 else 0):
            k1 = body_rates(state, *angles)
            k2 = body_rates(state + 0.5 * dt * k1, *angles)
            k3 = body_rates(state + 0.5 * dt * k2, *angles)
            k4 = body_rates(state + dt * k3, *angles)
            state = state + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state
