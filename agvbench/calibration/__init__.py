"""From measured runs to static maps."""

from agvbench.calibration.axles import axle_angles_from_arc, axle_angles_from_curvature
from agvbench.calibration.circle import CircleFit, CircleFits, fit_circle, fit_circles
from agvbench.calibration.frames import FrameQuality, clean_frames, inspect_frames
from agvbench.calibration.measure import RunMeasurement, measure_run
from agvbench.calibration.quaternion import quaternion_to_heading

__all__ = [
    "CircleFit",
    "CircleFits",
    "FrameQuality",
    "RunMeasurement",
    "axle_angles_from_arc",
    "axle_angles_from_curvature",
    "clean_frames",
    "fit_circle",
    "fit_circles",
    "inspect_frames",
    "measure_run",
    "quaternion_to_heading",
]
