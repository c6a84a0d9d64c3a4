"""Free driving (agvbench): slalom, S-curves and speed steps, to judge a model on driving it was not fitted to."""

import pytest


@pytest.mark.repeats(5)
@pytest.mark.experiment("free")
@pytest.mark.parametrize("condition", ["calibrated"])
@pytest.mark.parametrize("trajectory", ["slalom", "s_curve", "speed_steps"])
def bench_free(drive, trajectory, condition):
    """Drive a trajectory that excites steering and speed together."""
    drive.trajectory(trajectory, condition=condition)
