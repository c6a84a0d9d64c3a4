"""What commands ask of the actuators, and what effects remember of the commands before.

The drive and each axle may obey different commands at one time, because they answer after different waits.
"""

from __future__ import annotations

import math

from agvbench.effects.state import (
    ACCELERATE_LAG,
    ACCELERATION_LIMIT,
    BODY_ACCELERATION_LIMIT,
    BODY_BRAKING_LIMIT,
    BRAKE_LAG,
    BRAKING_LIMIT,
    COAST_RELAXATION,
    COAST_SPRING,
    CREEP_AT,
    DRIVE_BACKLASH,
    DRIVE_COMMAND,
    DRIVE_DIRECTION,
    DRIVE_HELD,
    DRIVE_INERTIA,
    DRIVE_LOAD,
    DRIVE_LOAD_AT,
    DRIVE_REVERSED,
    DRIVE_START,
    DRIVE_WAIT,
    DRIVES,
    FRONT_AIM,
    FRONT_BACKLASH,
    FRONT_BEFORE,
    FRONT_COMMAND,
    FRONT_CREEP,
    FRONT_HELD,
    FRONT_KEPT,
    FRONT_KEPT_AT,
    FRONT_LAGS,
    FRONT_LAGS_AT,
    FRONT_MOVED_TO,
    FRONT_REVERSAL,
    FRONT_SLIPPED,
    REAR_AIM,
    REAR_BACKLASH,
    REAR_BEFORE,
    REAR_COMMAND,
    REAR_CREEP,
    REAR_HELD,
    REAR_KEPT,
    REAR_KEPT_AT,
    REAR_LAG_RATIO,
    REAR_LAGS,
    REAR_LAGS_AT,
    REAR_MOVED_TO,
    REAR_REVERSAL,
    REAR_SLIPPED,
    RIGHT_RATE_RATIO,
    SPEED_AIM,
    START_HEADING,
    STEERING_ACCELERATION,
    STEERING_INERTIA,
    STEERING_LAG,
    STEERING_LOAD,
    STEERING_LOAD_AT,
    STEERING_RATE,
    TIME,
    YAW_INTEGRAL,
    YAW_INTEGRAL_AT,
    YAW_TARGET,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation.stages import aim, arrive
from agvbench.types import Floats


@compiled(inner=True)
def _last_reversal(reversal: float, before: float, now: float) -> float:
    """Return the angle at which the last change of direction took place, for a change from `before` to `now`."""
    return before if (now - before) * (before - reversal) < 0.0 else reversal


@compiled(inner=True)
def obey(
    s: Floats, p: Floats, commands: Floats, settled: Floats, driven: int, front: int, rear: int, lift: float, now: float
) -> None:
    """Put commands and aims into `s`; the `lift` of the drive level makes a driving command faster, either way.

    The drive obeys the row `driven`, the servos `front` and `rear`.
    """
    if commands[front, 1] != s[FRONT_COMMAND]:
        s[FRONT_BEFORE] = s[FRONT_AIM]
        s[FRONT_REVERSAL] = _last_reversal(s[FRONT_REVERSAL], settled[front - 1, 0], settled[front, 0])
    if commands[rear, 2] != s[REAR_COMMAND]:
        s[REAR_BEFORE] = s[REAR_AIM]
        s[REAR_REVERSAL] = _last_reversal(s[REAR_REVERSAL], settled[rear - 1, 1], settled[rear, 1])
    s[DRIVE_COMMAND], s[FRONT_COMMAND], s[REAR_COMMAND] = commands[driven, 0], commands[front, 1], commands[rear, 2]
    s[FRONT_AIM], s[REAR_AIM], s[SPEED_AIM] = settled[front, 0], settled[rear, 1], settled[driven, 2]
    drives = 1.0 if settled[driven, 2] != 0.0 else 0.0
    if drives > s[DRIVES]:
        s[DRIVE_START] = now
    s[DRIVES] = drives
    if settled[driven, 2] * s[DRIVE_DIRECTION] < 0.0:
        s[DRIVE_REVERSED] = now
    if settled[driven, 2] != 0.0:
        s[DRIVE_DIRECTION] = math.copysign(1.0, settled[driven, 2])
    if lift != 0.0 and settled[driven, 2] != 0.0:
        s[SPEED_AIM] = math.copysign(max(abs(settled[driven, 2]) + lift, 0.0), settled[driven, 2])
    s[STEERING_LAG], s[STEERING_RATE], s[ACCELERATE_LAG], s[BRAKE_LAG] = 0.0, math.inf, 0.0, 0.0
    s[FRONT_BACKLASH] = s[REAR_BACKLASH] = 0.0
    s[RIGHT_RATE_RATIO] = 1.0
    s[STEERING_INERTIA], s[STEERING_ACCELERATION], s[REAR_LAG_RATIO] = 0.0, math.inf, 1.0
    s[ACCELERATION_LIMIT] = s[BRAKING_LIMIT] = math.inf
    s[BODY_ACCELERATION_LIMIT] = s[BODY_BRAKING_LIMIT] = math.inf
    s[COAST_SPRING], s[COAST_RELAXATION], s[DRIVE_INERTIA], s[DRIVE_BACKLASH] = 0.0, math.inf, 0.0, 0.0
    if now > -math.inf:
        s[TIME] = now
    aim(s, p)


@compiled(inner=True)
def next_drive(s: Floats, p: Floats, settled: Floats, command_t_s: Floats, driven: int, last: int) -> tuple[float, int]:
    """Return when the drive obeys another row, and which: at a start, the one that closes the backlash."""
    if driven == last:
        return math.inf, driven
    row, at_s = driven + 1, arrive(s, command_t_s[driven + 1], p) + s[DRIVE_WAIT]
    left = s[DRIVE_BACKLASH] if settled[driven, 2] == 0.0 else 0.0
    while left > 0.0 and settled[row, 2] != 0.0:
        until_s = arrive(s, command_t_s[row + 1], p) + s[DRIVE_WAIT] if row < last else math.inf
        closed_s = at_s + left / abs(settled[row, 2])
        if closed_s <= until_s:
            return closed_s, row
        left, at_s, row = left - abs(settled[row, 2]) * (until_s - at_s), until_s, row + 1
    return at_s, row


@compiled(inner=True)
def reset_memory(s: Floats, commands: Floats, settled: Floats, first: int, heading: float) -> None:
    """Put into `s` what effects remember at the start of a run: there is no command before the first one."""
    s[FRONT_COMMAND], s[REAR_COMMAND] = commands[first, 1], commands[first, 2]
    s[FRONT_BEFORE], s[REAR_BEFORE] = settled[first, 0], settled[first, 1]
    s[FRONT_REVERSAL], s[REAR_REVERSAL] = settled[first, 0], settled[first, 1]
    s[FRONT_LAGS] = s[REAR_LAGS] = s[DRIVES] = 0.0
    s[FRONT_LAGS_AT], s[REAR_LAGS_AT] = settled[first, 0], settled[first, 1]
    s[FRONT_MOVED_TO], s[REAR_MOVED_TO] = settled[first, 0], settled[first, 1]
    s[STEERING_LOAD] = s[STEERING_LOAD_AT] = s[FRONT_CREEP] = s[REAR_CREEP] = s[CREEP_AT] = 0.0
    s[FRONT_HELD], s[REAR_HELD] = settled[first, 0], settled[first, 1]
    s[FRONT_KEPT], s[REAR_KEPT] = settled[first, 0], settled[first, 1]
    s[FRONT_KEPT_AT], s[REAR_KEPT_AT] = commands[first, 1], commands[first, 2]
    s[FRONT_SLIPPED] = s[REAR_SLIPPED] = 0.0
    s[DRIVE_LOAD] = s[DRIVE_LOAD_AT] = s[DRIVE_HELD] = s[DRIVE_DIRECTION] = 0.0
    s[DRIVE_REVERSED], s[START_HEADING] = -math.inf, heading
    s[YAW_INTEGRAL] = s[YAW_INTEGRAL_AT] = s[YAW_TARGET] = 0.0
