"""From measured runs to static maps."""

from agvbench.calibration.calibrate import Calibration, calibrate
from agvbench.calibration.identification import Identification, PoseNoise, identify
from agvbench.calibration.maps.map_fit import ExcludedPoint, MapFit
from agvbench.calibration.maps.selection import (
    compare_maps,
    drive_fitters,
    fit_drive_map,
    fit_steering_map,
    steering_fitters,
)
from agvbench.calibration.measurement.body_velocity import BodyVelocity, measure_body_velocity
from agvbench.calibration.measurement.circle import CircleFit, CircleFits, fit_circle, fit_circles
from agvbench.calibration.measurement.frames import FrameQuality, clean_frames, inspect_frames
from agvbench.calibration.measurement.run_measurement import RunMeasurement, measure_run
from agvbench.calibration.samples import CurvePoints
from agvbench.types import CALIBRATION_EXPERIMENTS
from agvbench.vehicle.kinematics import axle_angles_from_arc, axle_angles_from_curvature
from agvbench.vehicle.quaternion import quaternion_to_heading

__all__ = [
    "CALIBRATION_EXPERIMENTS",
    "BodyVelocity",
    "Calibration",
    "CircleFit",
    "CircleFits",
    "CurvePoints",
    "ExcludedPoint",
    "FrameQuality",
    "Identification",
    "MapFit",
    "PoseNoise",
    "RunMeasurement",
    "axle_angles_from_arc",
    "axle_angles_from_curvature",
    "calibrate",
    "clean_frames",
    "compare_maps",
    "drive_fitters",
    "fit_circle",
    "fit_circles",
    "fit_drive_map",
    "fit_steering_map",
    "identify",
    "inspect_frames",
    "measure_body_velocity",
    "measure_run",
    "quaternion_to_heading",
    "steering_fitters",
]
