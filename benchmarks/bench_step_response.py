"""Step response (agvbench): how fast the vehicle starts, stops and steers (thesis section 8.1, fig. 8.2).

Steering that changes while the vehicle drives distinguishes the lag of the steering servos from all else.
"""

import pytest


@pytest.mark.repeats(5)
@pytest.mark.experiment("step")
@pytest.mark.parametrize("share", [1.0, -1.0], ids=["forward", "backward"])
def bench_drive_step(drive, share):
    """Start, drive straight for six seconds, stop."""
    drive.hold(drive=share, for_s=6.0)


@pytest.mark.repeats(5)
@pytest.mark.experiment("step")
@pytest.mark.parametrize("axle", ["front", "rear"])
@pytest.mark.parametrize("share", [0.5, -0.5], ids=["left", "right"])
def bench_steering_step(drive, axle, share):
    """Steer in steps while driving: straight, one side, straight, the other side."""
    straight = {"drive": 1.0}
    steered, back = {"drive": 1.0, axle: share}, {"drive": 1.0, axle: -share}
    drive.steps([(2.0, straight), (1.5, steered), (1.5, straight), (1.5, back), (1.5, straight)])
