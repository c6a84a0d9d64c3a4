import pytest

from agvbench.model import example_vehicle, nominal_model, thesis_vehicle
from agvbench.planning import trajectory_from_table
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry


@pytest.fixture
def calibrated():
    return thesis_vehicle()


@pytest.fixture
def front_steered():
    return example_vehicle("front_steered")


@pytest.fixture
def nominal():
    return nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))


@pytest.fixture
def make():
    def make(**keys):
        return trajectory_from_table({"schema": 1, "name": "t", **keys})

    return make
