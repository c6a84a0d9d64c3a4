"""Physical effects that a vehicle model may have: one file each, found by file.

What an author of effects needs is here, and what hooks see in `agvbench.effects.state`.
"""

from agvbench.effects.actuation_delay import ActuationDelay
from agvbench.effects.axle_coupling import AxleCoupling
from agvbench.effects.axle_differential import AxleDifferential
from agvbench.effects.axle_overrun import AxleOverrun
from agvbench.effects.axle_speed_mismatch import AxleSpeedMismatch
from agvbench.effects.base import HOOKS, TIME_HOOKS, Effect, Parameter, Stage, parameter
from agvbench.effects.battery_droop import BatteryDroop
from agvbench.effects.cornering_speed_loss import CorneringSpeedLoss
from agvbench.effects.drive_dead_band import DriveDeadBand
from agvbench.effects.floor_tilt import FloorTilt
from agvbench.effects.heading_misalignment import HeadingMisalignment
from agvbench.effects.lateral_slip import LateralSlip
from agvbench.effects.marker_offset import MarkerOffset
from agvbench.effects.mocap_latency import MocapLatency
from agvbench.effects.mocap_scale import MocapScale
from agvbench.effects.registry import effect_from_toml, effect_kinds
from agvbench.effects.reverse_steering_gain import ReverseSteeringGain
from agvbench.effects.speed_lag import SpeedLag
from agvbench.effects.steering_backlash import SteeringBacklash
from agvbench.effects.steering_lag import SteeringLag
from agvbench.effects.steering_rate_limit import SteeringRateLimit
from agvbench.effects.steering_saturation import SteeringSaturation
from agvbench.effects.wheel_diameter_mismatch import WheelDiameterMismatch
from agvbench.effects.wheelbase_error import WheelbaseError

__all__ = [
    "HOOKS",
    "TIME_HOOKS",
    "ActuationDelay",
    "AxleCoupling",
    "AxleDifferential",
    "AxleOverrun",
    "AxleSpeedMismatch",
    "BatteryDroop",
    "CorneringSpeedLoss",
    "DriveDeadBand",
    "Effect",
    "FloorTilt",
    "HeadingMisalignment",
    "LateralSlip",
    "MarkerOffset",
    "MocapLatency",
    "MocapScale",
    "Parameter",
    "ReverseSteeringGain",
    "SpeedLag",
    "Stage",
    "SteeringBacklash",
    "SteeringLag",
    "SteeringRateLimit",
    "SteeringSaturation",
    "WheelDiameterMismatch",
    "WheelbaseError",
    "effect_from_toml",
    "effect_kinds",
    "parameter",
]
