"""Physical effects that a vehicle model may have: one file each, found by file."""

from agvbench.effects.actuation_delay import ActuationDelay
from agvbench.effects.base import HOOKS, TIME_HOOKS, Effect, Parameter, Stage, parameter
from agvbench.effects.registry import effect_from_toml, effect_kinds
from agvbench.effects.speed_lag import SpeedLag
from agvbench.effects.steering_lag import SteeringLag

__all__ = [
    "HOOKS",
    "TIME_HOOKS",
    "ActuationDelay",
    "Effect",
    "Parameter",
    "SpeedLag",
    "Stage",
    "SteeringLag",
    "effect_from_toml",
    "effect_kinds",
    "parameter",
]
