"""The eight test trajectories (agvbench): thesis section 8.2, each condition ten times; then the folder's own.

``--trajectories`` names others instead.

Trajectories 3 and 4, at half speed, have no uncalibrated condition: no half speed is known before calibration.
The condition ``corrected`` is driven where a model with effects is given with ``--corrected``. Own trajectories are the
files of ``trajectories/`` that do not ship with agvbench.
"""

import pytest


@pytest.mark.repeats
@pytest.mark.trajectories
@pytest.mark.experiment("trajectory")
@pytest.mark.parametrize("condition", ["uncalibrated", "calibrated", "corrected"])
def bench_trajectory(drive, trajectory, condition):
    """Drive one trajectory under one condition; the errors of its end pose follow from where it ends."""
    drive.trajectory(trajectory, condition=condition)
