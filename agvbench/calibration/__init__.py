"""From measured runs to static maps."""

from agvbench.calibration.circle import CircleFit, CircleFits, fit_circle, fit_circles
from agvbench.calibration.quaternion import quaternion_to_heading

__all__ = ["CircleFit", "CircleFits", "fit_circle", "fit_circles", "quaternion_to_heading"]
