"""Calibration (agvbench): the two procedures of the thesis, fig. 7.1 (steering) and fig. 7.2 (drive).

Commands are shares of full command: drive 1 is full speed forward, steering 1 full to the left (for the thesis'
vehicle 900 µs in both cases, 600 µs below neutral). The default grid finds slopes, end stops and the dead band;
``--full`` drives every pulse, configuration and repeat of the thesis. A vehicle for which that is too far on this floor
drives for a shorter time, and arcs then more slowly; speeds that do not fit the floor for two seconds are not driven.

A differential vehicle drives straights for its speed and turns on the spot for its yaw rate.
"""

import pytest

STEPS_OF_13 = [k / 6 for k in range(-6, 7)]
STEPS_OF_25 = [k / 12 for k in range(-12, 13)]
STEPS_OF_7 = [k / 3 for k in range(-3, 4)]
STEPS_OF_5 = [-1.0, -0.5, 0.0, 0.5, 1.0]


@pytest.mark.kinematics("two_axle")
@pytest.mark.repeats(2, full=10)
@pytest.mark.grid("share", STEPS_OF_13, STEPS_OF_13)
def bench_steering_front(drive, share):
    """Vary the front axle, keep the rear axle straight (table 7.1)."""
    drive.hold(drive=1.0, front=share, for_s=8.0, least_s=4.0, slower=True)


@pytest.mark.kinematics("two_axle")
@pytest.mark.repeats(2, full=10)
@pytest.mark.grid("share", STEPS_OF_13, STEPS_OF_13)
def bench_steering_rear(drive, share):
    """Vary the rear axle, keep the front axle straight (table 7.2)."""
    drive.hold(drive=1.0, rear=share, for_s=8.0, least_s=4.0, slower=True)


@pytest.mark.kinematics("two_axle")
@pytest.mark.repeats(1, full=10)
@pytest.mark.grid("share", STEPS_OF_5, STEPS_OF_5)
def bench_steering_opposite(drive, share):
    """Vary both axles in opposite direction (table 7.3)."""
    drive.hold(drive=1.0, front=share, rear=-share, for_s=8.0, least_s=4.0, slower=True)


@pytest.mark.repeats(3, full=1)
@pytest.mark.grid("steering", [0.0], STEPS_OF_7)
@pytest.mark.grid("configuration", ["straight"], ["single", "double", "crab"])
@pytest.mark.grid("share", STEPS_OF_25, STEPS_OF_25)
def bench_drive(drive, share, configuration, steering):
    """Vary the drive command (table 7.4); with ``--full`` for each steering angle and configuration (appendix B)."""
    rear = {"straight": 0.0, "single": 0.0, "double": -steering, "crab": steering}[configuration]
    drive.hold(drive=share, front=steering, rear=rear, for_s=6.0, least_s=2.0)


@pytest.mark.kinematics("differential")
@pytest.mark.repeats(3, full=10)
@pytest.mark.grid("share", STEPS_OF_13, STEPS_OF_25)
def bench_yaw_rate(drive, share):
    """Turn on the spot: vary the yaw rate command, keep the speed at neutral."""
    drive.hold(front=share, for_s=6.0)
