"""Physical effects that a vehicle model may have: one file each, in the folder of its part of the vehicle.

What an author of effects needs is here, and what hooks see in `agvbench.effects.state`.
"""

from agvbench.effects.axles.axle_coupling import AxleCoupling
from agvbench.effects.axles.axle_differential import AxleDifferential
from agvbench.effects.axles.axle_overrun import AxleOverrun
from agvbench.effects.axles.axle_speed_mismatch import AxleSpeedMismatch
from agvbench.effects.axles.wheel_diameter_mismatch import WheelDiameterMismatch
from agvbench.effects.axles.wheelbase_error import WheelbaseError
from agvbench.effects.base import HOOKS, TIME_HOOKS, Effect, Parameter, Stage, parameter
from agvbench.effects.camera.heading_misalignment import HeadingMisalignment
from agvbench.effects.camera.marker_offset import MarkerOffset
from agvbench.effects.camera.mocap_latency import MocapLatency
from agvbench.effects.camera.mocap_scale import MocapScale
from agvbench.effects.drive.drive_dead_band import DriveDeadBand
from agvbench.effects.drive.speed_lag import SpeedLag
from agvbench.effects.electronics.actuation_delay import ActuationDelay
from agvbench.effects.electronics.battery_droop import BatteryDroop
from agvbench.effects.ground.cornering_speed_loss import CorneringSpeedLoss
from agvbench.effects.ground.floor_tilt import FloorTilt
from agvbench.effects.ground.lateral_slip import LateralSlip
from agvbench.effects.registry import effect_from_toml, effect_kinds
from agvbench.effects.steering.reverse_steering_gain import ReverseSteeringGain
from agvbench.effects.steering.steering_backlash import SteeringBacklash
from agvbench.effects.steering.steering_lag import SteeringLag
from agvbench.effects.steering.steering_rate_limit import SteeringRateLimit
from agvbench.effects.steering.steering_saturation import SteeringSaturation

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
