"""Corrected plans of the eight test trajectories, before they are compared (agvbench): what they still miss is learned.

`agvbench loop` drives these between its two sessions. They are runs of their own, so that the scatter of the runs that
are compared is not learned.
"""

import pytest

THE_EIGHT = [str(number) for number in range(1, 9)]


@pytest.mark.repeats
@pytest.mark.experiment("trial")
@pytest.mark.parametrize("condition", ["corrected"])
@pytest.mark.parametrize("trajectory", THE_EIGHT)
def bench_trial(drive, trajectory, condition):
    """Drive one trajectory corrected; where it ends says what the model still misses."""
    drive.trajectory(trajectory, condition=condition)
