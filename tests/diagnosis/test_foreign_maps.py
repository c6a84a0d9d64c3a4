"""End stops and dead bands that the believed vehicle lacks, and maps that lack nothing."""

import dataclasses

import numpy as np
import pytest
from tiny_vehicle import FRONT_M, REAR_M, Tiny

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.findings.map_shapes import RefittedMap, dead_band, end_stops
from agvbench.model import VehicleModel
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import DeadBandWithSaturation, Line, LineWithEndStops

BELIEVED = VehicleModel(
    "tiny",
    Geometry(FRONT_M, REAR_M),
    Channels.alike("us"),
    front=Line(-0.0014, 2.1),
    rear=Line(-0.0014, 2.1),
    drive=Line(-0.0006, 0.9),
)
LEVELS = np.linspace(-0.9, 0.9, 9)


def refitted(values, stderr=0.001, seed=0, commands=LEVELS):
    noise = np.random.default_rng(seed).normal(0.0, stderr, len(commands))
    return RefittedMap(commands, values + noise, np.eye(len(commands)) * stderr**2)


def test_end_stops_are_found_where_the_line_stops():
    found = end_stops(refitted(np.clip(0.7 * LEVELS + 0.02, -0.45, 0.41)), Line(0.8, 0.0))
    assert found is not None
    assert found.low[0] == pytest.approx(-0.45, abs=0.004)
    assert found.high[0] == pytest.approx(0.41, abs=0.004)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "values",
    [0.5 * LEVELS + 0.08, 0.7 * LEVELS - 0.15 * LEVELS**3, np.sin(0.9 * LEVELS), np.arctan(1.2 * LEVELS)],
    ids=["another line", "cubic", "sine", "arctangent"],
)
def test_another_slope_or_a_smooth_bend_is_no_end_stop(values, seed):
    assert end_stops(refitted(values, seed=seed), Line(0.8, 0.0)) is None


def banded(width, offset=0.0):
    away = np.sign(LEVELS - offset) * np.maximum(np.abs(LEVELS - offset) - width, 0.0)
    return 0.4 * away[LEVELS != 0.0], LEVELS[LEVELS != 0.0]


def test_a_dead_band_is_found_where_levels_lead_back_to_it():
    values, commands = banded(0.15)
    found = dead_band(refitted(values, 3e-4, commands=commands), Line(0.4, 0.0), 0.0)
    assert found is not None
    assert found.width == pytest.approx(0.15, abs=2.0 * found.stderr + 0.005)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("offset", [0.0, 0.08])
def test_another_neutral_is_no_dead_band(offset, seed):
    values, commands = banded(0.0, offset)
    assert dead_band(refitted(values, 3e-4, seed, commands), Line(0.5, 0.0), 0.0) is None


def test_a_line_that_was_believed_lacks_both(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny()), vehicle=BELIEVED)
    assert found.verdict is Verdict.NAMED
    named = {effect.name: effect.parameters for effect in found.effects}
    assert set(named) == {"steering_saturation", "drive_dead_band"}
    assert named["steering_saturation"]["front_rad"].value == pytest.approx(0.71, abs=0.02)
    assert named["steering_saturation"]["rear_rad"].value == pytest.approx(0.685, abs=0.02)
    # The drive of this vehicle bends by a law of its own, so that its edge is read off less well.
    assert named["drive_dead_band"]["width"].value == pytest.approx(40.0, abs=8.0)
    assert found.to_json()["effects"][0]["parameters"]["front_rad"]["unit"] == "rad"


def test_what_the_believed_maps_have_is_not_named(tiny_campaign):
    stops = LineWithEndStops(-0.0014, 2.1, -0.8, 0.8)
    drive = DeadBandWithSaturation(900.0, 1480.0, 1520.0, 2100.0, 0.32, -0.32)
    knows = dataclasses.replace(BELIEVED, front=stops, rear=stops, drive=drive)
    assert diagnose(tiny_campaign(Tiny()), vehicle=knows).verdict is Verdict.ADEQUATE
