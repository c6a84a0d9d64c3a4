"""Corrected plans of the trajectories, before they are compared (agvbench): their end-pose bias is learned.

`agvbench loop` drives these between its two sessions. They are runs of their own, so that the random errors of the
runs that are compared are not learned.
"""

import pytest


@pytest.mark.repeats
@pytest.mark.trajectories
@pytest.mark.experiment("trial")
@pytest.mark.parametrize("condition", ["corrected"])
def bench_trial(drive, trajectory, condition):
    """Drive one trajectory corrected; its end pose shows the bias of the model."""
    drive.trajectory(trajectory, condition=condition)
