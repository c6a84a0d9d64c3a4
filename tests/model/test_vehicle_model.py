"""The composed model: forward, inverse, nominal values, and the shipped vehicles."""

from __future__ import annotations

import csv
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.effects import ActuationDelay, SteeringLag
from agvbench.errors import VehicleError
from agvbench.model import VehicleModel, example_names, example_path, example_vehicle, nominal_model, thesis_vehicle
from agvbench.model.thesis import build_thesis_vehicle
from agvbench.resources import resource_directory
from agvbench.types import Command
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, Line

GEOMETRY = Geometry(0.181, 0.121)
THESIS_TABLES = resource_directory("reports") / "reference" / "thesis"


def test_the_shipped_thesis_vehicle_is_what_its_tables_give() -> None:
    built = build_thesis_vehicle(THESIS_TABLES)
    shipped = thesis_vehicle()
    assert shipped == built
    assert shipped.calibration_hash == built.calibration_hash
    assert "1100 to 1900 us" in str(shipped.provenance["front"])


def test_the_thesis_vehicle_passes_near_every_measured_point() -> None:
    model = thesis_vehicle()
    for number, axle in (("7_1", "front"), ("7_2", "rear")):
        with (THESIS_TABLES / f"table_{number}_{axle}_servo_varied.csv").open() as stream:
            rows = [(float(r["pulse_us"]), float(r[f"{axle}_median_deg"])) for r in csv.DictReader(stream)]
        for pulse, angle_deg in rows:
            assert math.degrees(float(getattr(model, axle)(pulse))) == pytest.approx(angle_deg, abs=0.7)
    with (THESIS_TABLES / "table_7_4_straight_speed.csv").open() as stream:
        for row in csv.DictReader(stream):
            assert float(model.speed(float(row["drive_pulse_us"]))) == pytest.approx(float(row["speed_mps"]), abs=0.002)


def test_thesis_signs_a_falling_pulse_turns_left_and_drives_forward() -> None:
    model = thesis_vehicle()
    front, rear = model.axle_angles([1200.0, 1800.0], [1200.0, 1800.0])
    assert front[0] > 0.3 > -0.3 > front[1]
    assert rear[0] > 0.3 > -0.3 > rear[1]
    assert float(model.speed(1200.0)) > 0.3 > -0.25 > float(model.speed(1800.0))


@pytest.mark.parametrize("name", example_names())
@given(shares=st.tuples(*[st.floats(0.0, 1.0)] * 3))
def test_command_for_inverts_the_maps(name: str, shares: tuple[float, float, float]) -> None:
    model = example_vehicle(name)
    ranges = (model.front.output_range, model.rear.output_range, model.drive.output_range)
    front, rear, speed = (low + share * (high - low) for share, (low, high) in zip(shares, ranges, strict=True))
    command = model.command_for(front, rear, speed)
    assert float(model.speed(command.drive)) == pytest.approx(speed, abs=1e-9)
    assert [float(a) for a in model.axle_angles(command.front, command.rear)] == pytest.approx([front, rear], abs=1e-9)


def test_standing_still_and_an_axle_that_is_not_steered_are_commanded_neutral() -> None:
    skewed = replace(example_vehicle("front_steered"), rear=Fixed(command=0.25))
    assert skewed.command_for(0.1, 0.0, 0.0) == Command(drive=0.0, front=pytest.approx((0.1 - 0.008) / 0.42), rear=0.0)


@pytest.mark.parametrize(
    ("front_deg", "rear_deg", "speed", "message"),
    [
        (52.0, 0.0, 0.1, "vehicle thesis: front angle is out of reach: 52 ° (limit: -41.64 … 40.19 °)"),
        (0.0, -45.0, 0.1, "vehicle thesis: rear angle is out of reach: -45 ° (limit: -39.47 … 39.81 °)"),
        (0.0, 0.0, 0.5, "vehicle thesis: drive speed is out of reach: 0.5 m/s (limit: -0.3233 … 0.3228 m/s)"),
        (0.0, 0.0, math.nan, "vehicle thesis: drive speed is out of reach: nan m/s"),
    ],
)
def test_what_is_out_of_reach_is_refused_with_its_limit(
    front_deg: float, rear_deg: float, speed: float, message: str
) -> None:
    with pytest.raises(VehicleError) as caught:
        thesis_vehicle().command_for(math.radians(front_deg), math.radians(rear_deg), speed)
    assert str(caught.value).startswith(message)


def test_the_nominal_model_has_the_thesis_values_and_knows_no_half_speed() -> None:
    model = nominal_model("agv", GEOMETRY, Channels.alike("us"))
    assert np.degrees(model.front([900.0, 1500.0, 2100.0])).tolist() == pytest.approx([45.0, 0.0, -45.0])
    assert model.speed([900.0, 1500.0, 2100.0]).tolist() == [0.32, 0.0, -0.32]
    assert model.command_for(0.0, 0.0, -0.32) == Command(2100.0, 1500.0, 1500.0)
    with pytest.raises(VehicleError, match=r"^vehicle agv: no command is known for this output: 0\.16 m/s"):
        model.command_for(0.0, 0.0, 0.16)


def test_the_nominal_model_in_normalised_units_turns_left_and_forward_on_positive_commands() -> None:
    model = nominal_model("car", GEOMETRY, Channels.alike("normalised"), rear_steered=False)
    assert math.degrees(float(model.front(1.0))) == pytest.approx(45.0)
    assert model.rear([-1.0, 1.0]).tolist() == [0.0, 0.0]
    assert model.command_for(math.radians(-45.0), 0.0, 0.32) == Command(1.0, -1.0, 0.0)


def test_effects_are_found_added_and_replaced_by_name() -> None:
    model = thesis_vehicle().with_effects(SteeringLag(0.1), ActuationDelay(0.05))
    slower = model.with_effects(SteeringLag(0.2))
    assert slower.effect("steering_lag") == SteeringLag(0.2)
    assert slower.effect("actuation_delay") == ActuationDelay(0.05)
    assert thesis_vehicle().effect("steering_lag") is None
    with pytest.raises(VehicleError, match="effects: an effect may be given once: steering_lag"):
        replace(model, effects=(SteeringLag(0.1), SteeringLag(0.2)))


def test_calibration_hash_follows_the_physics_only() -> None:
    model = thesis_vehicle()
    same = [
        replace(model, name="other", provenance={"by": "hand"}),
        replace(model, effects=(SteeringLag(0.0),)),
        pickle.loads(pickle.dumps(model)),  # noqa: S301
    ]
    assert {m.calibration_hash for m in same} == {model.calibration_hash}
    different = [
        replace(model, channels=Channels.alike("us", 1501.0)),
        replace(model, channels=Channels.alike("normalised", 1500.0)),
        replace(model, geometry=Geometry(0.181, 0.1211)),
        replace(model, front=model.rear),
        replace(model, effects=(SteeringLag(0.1),)),
        replace(model, effects=(SteeringLag(0.2),)),
    ]
    assert len({m.calibration_hash for m in [model, *different]}) == 1 + len(different)
    lag, delay = SteeringLag(0.1), ActuationDelay(0.1)
    assert (
        replace(model, effects=(lag, delay)).calibration_hash == replace(model, effects=(delay, lag)).calibration_hash
    )


def test_the_hash_of_the_shipped_vehicle_stays_the_same_over_versions() -> None:
    # Campaigns carry this hash: changing it on purpose needs a new schema.
    assert thesis_vehicle().calibration_hash == "22164d37c5982252"


def test_angles_that_no_axle_reaches_are_refused() -> None:
    with pytest.raises(VehicleError, match=r"^maps\.front: axle angle is too large: -?114\.6° \(limit: ±89°\)"):
        replace(thesis_vehicle(), front=Line(1.0, 0.0, -2.0, 2.0))


def test_examples_ship_and_unknown_ones_are_named() -> None:
    assert isinstance(VehicleModel.load(example_path("thesis")), VehicleModel)
    with pytest.raises(VehicleError, match=r"truck \(one of: differential, front_steered, thesis\)"):
        example_path("truck")
