"""Vehicle models: static maps, kinematics and effects."""

from agvbench.model.examples import example_names, example_path, example_vehicle, thesis_vehicle
from agvbench.model.nominal import nominal_model
from agvbench.model.priors import Prior
from agvbench.model.vehicle_model import VehicleModel

__all__ = [
    "Prior",
    "VehicleModel",
    "example_names",
    "example_path",
    "example_vehicle",
    "nominal_model",
    "thesis_vehicle",
]
