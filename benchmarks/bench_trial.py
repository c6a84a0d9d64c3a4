"""Corrected plans of the trajectories, before they are compared (agvbench): what they still miss is learned.

`agvbench loop` drives these between its two sessions. They are runs of their own, so that the scatter of the runs that
are compared is not learned.
"""

import pytest


@pytest.mark.repeats
@pytest.mark.trajectories
@pytest.mark.experiment("trial")
@pytest.mark.parametrize("condition", ["corrected"])
def bench_trial(drive, trajectory, condition):
    """Drive one trajectory corrected; where it ends says what the model still misses."""
    drive.trajectory(trajectory, condition=condition)
