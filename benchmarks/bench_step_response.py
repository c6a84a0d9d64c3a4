"""Step response (agvbench): how fast the vehicle starts, stops and steers (thesis section 8.1, fig. 8.2).

Steering that changes while the vehicle drives distinguishes the lag of the steering servos from all else. A
differential vehicle also drives arcs with the yaw rates of its turns on the spot: their difference is slip, which no
static map has.
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


@pytest.mark.kinematics("differential")
@pytest.mark.repeats(2)
@pytest.mark.experiment("step")
@pytest.mark.parametrize("speed", [1.0, 0.5, -0.5, -1.0])
@pytest.mark.parametrize("yaw_rate", [2 / 3, 1 / 3, -1 / 3, -2 / 3], ids=["2/3", "1/3", "-1/3", "-2/3"])
def bench_arc(drive, speed, yaw_rate):
    """Turn while driving, with each speed and each yaw rate."""
    drive.hold(drive=speed, front=yaw_rate, for_s=4.0, least_s=2.0)
