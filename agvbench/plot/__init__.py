"""Figures: functions that draw on matplotlib axes that they are given, and return these axes.

::

    figure, axes = plt.subplots()
    agvbench.plot.end_poses(axes, campaign, trajectory="5")

Nothing here makes a figure, shows one, or changes matplotlib's settings. Colours and markers of conditions are those
of the report, and colour-blind readers can distinguish them.
"""

from agvbench.plot.calibration_curves import calibration_curve
from agvbench.plot.comparisons import comparison
from agvbench.plot.driven_paths import paths
from agvbench.plot.residual_steps import residuals
from agvbench.plot.target_frame import end_poses

__all__ = ["calibration_curve", "comparison", "end_poses", "paths", "residuals"]
