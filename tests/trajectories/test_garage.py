"""The garage: forward past it, then backward into it, to the pose of a car that is parked."""

import math

import numpy as np
import pytest

from agvbench.model import nominal_model, thesis_vehicle
from agvbench.planning import load_trajectory, plan
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

RADIUS_M, PAST_M, INTO_M = 0.7, 0.5, 0.8
EIGHTH = math.sqrt(0.5)
MODELS = [thesis_vehicle(), nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))]


def parked():
    """Return where the segments lead, by hand: two eighths of circles that touch, a straight before and one after."""
    return PAST_M + RADIUS_M * (2.0 * EIGHTH - 1.0), RADIUS_M * (1.0 - 2.0 * EIGHTH) - INTO_M, math.pi / 2.0


@pytest.mark.parametrize("model", MODELS, ids=["thesis", "nominal"])
def test_it_ends_in_the_garage_with_its_nose_to_the_door(model):
    made = plan(load_trajectory("garage"), model)
    assert made.target == pytest.approx(parked(), abs=1e-12)
    np.testing.assert_allclose(made.expected[-1, 1:], parked(), atol=1e-9)


def test_it_drives_forward_stops_and_drives_backward():
    drive = plan(load_trajectory("garage"), MODELS[1]).commands.drive
    gears = np.sign(1500.0 - drive)
    assert gears[gears != 0.0].tolist() == [1.0, 1.0, -1.0, -1.0]
    turn = int(np.argmax(gears < 0.0))
    assert gears[turn - 1] == 0.0
