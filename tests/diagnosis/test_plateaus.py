"""Values of the maps that no run tells any more, where play leaves a plateau, find their way off it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_vehicle import (
    FRONT_M,
    NEUTRAL,
    NEUTRAL_COMMAND,
    REAR_M,
    InMemory,
    Tiny,
    campaign_runs,
    drive,
    held,
    rear_of,
    switched,
)

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.estimation.fit import fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps, nodal_maps
from agvbench.diagnosis.model.steady_drives import start_values, steady_drives
from agvbench.diagnosis.selection.candidates import bounds_of, candidates
from agvbench.diagnosis.selection.stepwise import Selector
from agvbench.effects import SteeringLag
from agvbench.effects.steering.steering_backlash import SteeringBacklash
from agvbench.types import Pose
from agvbench.vehicle.geometry import Geometry

MAPS = NodalMaps(
    {"front": np.array([1000.0, 1400.0]), "rear": np.array([1000.0, 1500.0, 2000.0]), "drive": np.array([1600.0])},
    NEUTRAL_COMMAND,
)
PLAY_RAD, MORE_PLAY_RAD = 0.028, 0.09
NEARLY_STRAIGHT = 1487.0


def test_values_that_no_run_tells_are_laid_between_the_others_of_their_role():
    unobserved = np.array([False, True, False, True, False, True])
    laid = MAPS.interpolated(np.array([0.5, 9.0, 0.6, 9.0, -0.4, 9.0]), unobserved)
    # An outer value is that of its neighbour; the drive stands still at neutral.
    assert laid == pytest.approx([0.5, 0.5, 0.6, 0.1, -0.4, 0.0])


def test_values_that_all_are_silent_stay():
    values = np.array([0.5, 9.0, 0.6, 9.0, -0.4, 0.3])
    assert MAPS.interpolated(values, np.array([True, True, False, False, False, False])) == pytest.approx(values)


def driven(play_rad):
    """Return a campaign with play, in which one command ends hardly beyond it."""
    tiny, rng = Tiny(play_rad=play_rad), np.random.default_rng(5)
    runs = campaign_runs(tiny)
    straight = [NEUTRAL] * 4
    ways = [[a, NEUTRAL, b, NEUTRAL] for a, b in ((1300.0, 1700.0), (1600.0, 1400.0))]
    more = [
        held(900.0, NEUTRAL, NEARLY_STRAIGHT, 4.0),
        *(switched(900.0, back_and_forth, straight, 1.2) for back_and_forth in ways),
        *(switched(2100.0, straight, back_and_forth, 1.2) for back_and_forth in ways),
    ]
    for k, commands in enumerate(4 * more):
        frames = drive(tiny, commands, Pose(0.1 * k, 0.0, 0.3 * k), runs[-1].started_s + 60.0, rng)
        started_s = runs[-1].started_s + 60.0
        runs.append(replace(runs[0], run_id=f"more-{k}", commands=commands, frames=frames, started_s=started_s))
    return InMemory(runs)


@pytest.fixture(scope="module")
def play():
    return driven(PLAY_RAD)


@pytest.fixture(scope="module")
def selector(play):
    """Return a selector of these runs."""
    readings, geometry = read_runs(play.runs, NEUTRAL_COMMAND), Geometry(FRONT_M, REAR_M)
    maps = nodal_maps(readings.runs, NEUTRAL_COMMAND)
    prior_model = {role: np.zeros(len(maps.nodes[role])) for role in ROLES}
    start = start_values(maps, steady_drives(play.runs, geometry, NEUTRAL_COMMAND), prior_model)
    return Selector(Batch(readings, maps, geometry), candidates(geometry), start, 0, lambda _: None)


def test_a_fit_that_begins_on_a_plateau_ends_where_others_do(selector):
    good = selector.with_effect(selector.base(), "steering_backlash").fit
    maps, rear = selector.batch.maps, selector.batch.maps.slices()["rear"]
    node = rear.start + int(np.searchsorted(maps.nodes["rear"], NEARLY_STRAIGHT))
    begun = good.parameters.copy()
    begun[node] = rear_of(NEUTRAL) + 0.2 * PLAY_RAD
    bounds = bounds_of(("steering_backlash",))
    again = fit(
        good.predictor,
        begun,
        bounds,
        random_effects=good.random_effects,
        variance_components=good.variance_components,
        iterations=10,
    )
    assert again.loss.sum() == pytest.approx(good.loss.sum(), abs=1.0)
    assert again.parameters[node] == pytest.approx(rear_of(NEARLY_STRAIGHT), abs=3e-3)


def test_maps_beside_play_lie_half_of_it_farther_from_neutral():
    values = np.array([0.4, 0.1, 0.5, -0.02, -0.4, 0.3])
    laid = MAPS.beside(values, SteeringBacklash, np.array([0.06]))
    # Both axles' outer values; neutral's own (front: beyond the last node, rear: the middle one) and the drive's stay.
    assert laid == pytest.approx([0.43, 0.1, 0.53, -0.02, -0.43, 0.3])
    assert MAPS.beside(values, SteeringLag, np.array([0.2])) == pytest.approx(values)


@pytest.mark.slow
def test_play_is_found_where_a_command_ends_hardly_beyond_it(play):
    found = diagnose(play)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == "steering_backlash"
    width = effect.parameters["width_rad"]
    assert abs(width.value - PLAY_RAD) < 3.0 * width.stderr + 5e-4
    assert found.model is not None
    assert float(found.model.rear(NEARLY_STRAIGHT)) == pytest.approx(rear_of(NEARLY_STRAIGHT), abs=3e-3)


@pytest.mark.slow
def test_much_play_is_found_too():
    (effect,) = diagnose(driven(MORE_PLAY_RAD)).effects
    assert effect.name == "steering_backlash"
    assert effect.parameters["width_rad"].value == pytest.approx(MORE_PLAY_RAD, abs=3e-3)
