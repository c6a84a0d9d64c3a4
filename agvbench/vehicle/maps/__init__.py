"""Static maps from command to steering angle or speed: one file each, found by file."""

from agvbench.vehicle.maps.base import StaticMap, map_from_toml, map_kinds
from agvbench.vehicle.maps.cubic import Cubic
from agvbench.vehicle.maps.dead_band_with_saturation import DeadBandWithSaturation
from agvbench.vehicle.maps.fixed import Fixed
from agvbench.vehicle.maps.full_speed_or_stop import FullSpeedOrStop
from agvbench.vehicle.maps.line import Line
from agvbench.vehicle.maps.line_with_end_stops import LineWithEndStops
from agvbench.vehicle.maps.monotone_table import MonotoneTable

__all__ = [
    "Cubic",
    "DeadBandWithSaturation",
    "Fixed",
    "FullSpeedOrStop",
    "Line",
    "LineWithEndStops",
    "MonotoneTable",
    "StaticMap",
    "map_from_toml",
    "map_kinds",
]
