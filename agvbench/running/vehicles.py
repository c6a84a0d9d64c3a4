"""Which vehicle is believed before anything is measured."""

from __future__ import annotations

from agvbench.model import VehicleModel, nominal_model
from agvbench.vehicle.geometry import Geometry


def uncalibrated_vehicle(path: str = "") -> VehicleModel:
    """Return the vehicle of the file `path`, or the thesis' vehicle (table 5.1) with nominal maps.

    Raises
    ------
    VehicleError
        If the file cannot be used.
    """
    if path:
        return VehicleModel.load(path)
    return nominal_model("model AGV", Geometry(front_axle_m=0.181, rear_axle_m=0.121), "us", 1500.0)
