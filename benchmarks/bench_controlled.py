"""Closed loop (agvbench): the figure eight by two controllers, beside its open-loop plan.

``agvbench bench calibration controlled`` drives it. A controller of your own is a factory like these.
"""

import pytest

from agvbench.control import PurePursuit, Stanley

CONTROLLERS = {"pure_pursuit": PurePursuit, "stanley": Stanley}


@pytest.mark.repeats
@pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
@pytest.mark.parametrize("trajectory", ["figure_eight"])
def bench_open_loop(drive, trajectory, condition):
    """Drive the plan as it is."""
    drive.trajectory(trajectory, condition=condition)


@pytest.mark.repeats
@pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("trajectory", ["figure_eight"])
def bench_closed_loop(drive, trajectory, controller, condition):
    """Drive the same path with a controller that sees the pose ten times a second."""
    drive.controlled(trajectory, CONTROLLERS[controller], condition=condition)
