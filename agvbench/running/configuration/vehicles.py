"""The vehicle models of a session: the nominal one, and those of the other conditions."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from agvbench.errors import AgvbenchError
from agvbench.model import VehicleModel, nominal_model, thesis_vehicle
from agvbench.running.configuration.lab_file import LabFile
from agvbench.running.configuration.settings import BenchSettings
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import FullSpeedOrStop, MonotoneTable

DIFFERENTIAL_PLANT = "agvbench.simulator:differential_plant"
LAB_VEHICLE = "vehicle.toml"
"""The vehicle of a lab folder: every command takes it where no other is named."""


def lab_vehicle() -> str:
    """Return the vehicle file of the current folder, or "" where it has none."""
    return LAB_VEHICLE if Path(LAB_VEHICLE).is_file() else ""


def with_lab_vehicle(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options `given`, by default with the lab folder's vehicle and plant, or a plant of its kind.

    Raises
    ------
    FileError
        If ``lab.toml`` cannot be read.
    """
    options = {"vehicle": lab_vehicle(), **given}
    return options if "plant" in given else {"plant": default_plant(options["vehicle"]), **options}


def default_plant(vehicle: str) -> str:
    """Return the plant that the lab folder names, else one of the kind of the vehicle file `vehicle`.

    Without a vehicle it is that of the thesis' vehicle. A vehicle that cannot be read is refused where it is used.

    Raises
    ------
    FileError
        If ``lab.toml`` cannot be read.
    """
    if plant := LabFile.of_folder().plant:
        return plant
    with suppress(AgvbenchError):
        if vehicle and VehicleModel.load(vehicle).geometry.is_differential:
            return DIFFERENTIAL_PLANT
    return BenchSettings.plant


def known_models(settings: BenchSettings) -> dict[str, VehicleModel]:
    """Return the models that are known before anything is driven, by condition.

    Raises
    ------
    VehicleError
        If one of their files cannot be used.
    """
    models = {"uncalibrated": uncalibrated_vehicle(settings.vehicle)}
    if settings.calibration:
        models["calibrated"] = VehicleModel.load(settings.calibration)
    if settings.corrected:
        models["corrected"] = VehicleModel.load(settings.corrected)
    return models


def uncalibrated_vehicle(path: str = "") -> VehicleModel:
    """Return the vehicle of the file `path`, or the thesis' vehicle (table 5.1) with nominal maps.

    Raises
    ------
    VehicleError
        If the file cannot be used.
    """
    if path:
        return VehicleModel.load(path)
    return nominal_model("model AGV", Geometry(front_axle_m=0.181, rear_axle_m=0.121), Channels.alike("us"))


def expected_calibration(path: str = "") -> VehicleModel:
    """Return what stands in for the calibrated vehicle while nothing was measured: axles, unit and neutral are its own.

    Where only full speed and stop are known of the drive, it is taken to be straight between them.

    Raises
    ------
    VehicleError
        If the file `path` cannot be used.
    """
    if not path:
        return thesis_vehicle()
    nominal = uncalibrated_vehicle(path)
    drive = nominal.drive
    if not isinstance(drive, FullSpeedOrStop):
        return nominal
    commands = (drive.command_low, drive.command_stop, drive.command_high)
    speeds = (drive.output_low, 0.0, drive.output_high)
    return replace(nominal, drive=MonotoneTable(commands, speeds, interpolation="linear"))
