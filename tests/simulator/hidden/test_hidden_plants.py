"""What holds for every hidden plant: the plant contract, no effect at null, determinism, a sealed truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hidden_truth import START, poses, quiet

from agvbench.errors import PlantError
from agvbench.simulator import check_plant, load_plant
from agvbench.simulator.hidden import constants, make_hidden_plant, make_plant
from agvbench.simulator.hidden import sampling as drawing
from agvbench.simulator.hidden.catalogue import CATALOGUE, NOTHING, recipes

PAIRS = ["steering_lag_and_lateral_slip", "actuation_delay_and_slow_patch", "mocap_latency_and_marker_offset"]
ROUTE = [
    (0.5, 0.0, 0.3, 0.0),
    (1.0, 1.0, 0.3, -0.2),
    (1.0, 1.0, -0.3, 0.0),
    (1.0, -0.5, 0.2, 0.2),
    (0.5, 0.0, 0.0, 0.0),
]
# Where the null is not "every size 0, every limit infinite".
NULLS = {
    "steering_lag_second_order": {"frequency_rad_per_s": 0.0, "damping": 1.0},
    "steering_rate_limit_accelerated": {"rate_rad_per_s": math.inf, "acceleration_rad_per_s2": math.inf},
    "stick_slip": {"twist_rad": 0.0, "duration_s": 0.0},
}


def as_drawn(spec):
    return lambda seed: make_hidden_plant(spec, seed, floors=0.0)


@pytest.mark.parametrize("spec", [NOTHING, *CATALOGUE, *PAIRS])
def test_keeps_the_plant_contract(spec):
    check_plant(as_drawn(spec))


@pytest.mark.parametrize("name", CATALOGUE)
def test_null_size_is_the_base_plant_bit_for_bit(name):
    recipe = CATALOGUE[name]
    values = recipe.draw(np.random.default_rng(1))
    null = {k: {1: 0.0, -1: math.inf, 0: v}[recipe.sizes[k].grows] for k, v in values.items()} | NULLS.get(name, {})
    assert np.array_equal(poses(quiet(**recipe.constants(null)), ROUTE), poses(quiet(), ROUTE))


@pytest.mark.parametrize("name", CATALOGUE)
def test_drawn_size_is_not_the_base_plant(name):
    drawn = CATALOGUE[name].constants(CATALOGUE[name].draw(np.random.default_rng(1)))
    # Across the room, over seams and patches; then within a dead band, beyond a limit, and to and fro.
    rows, west = [(8.0, 1.0, 0.0, 0.0), (2.0, 0.15, 0.5, -0.5), *ROUTE, *ROUTE], (-1.2, 0.0, 0.0)
    assert not np.array_equal(poses(quiet(**drawn), rows, west), poses(quiet(), rows, west))


def test_an_effect_grows_stronger_and_keeps_its_sign():
    for recipe in CATALOGUE.values():
        values = recipe.draw(np.random.default_rng(2))
        for name, value in recipe.grown(values, 1.3).items():
            grows = recipe.sizes[name].grows
            assert math.copysign(1.0, value) == math.copysign(1.0, values[name])
            assert (abs(value) - abs(values[name])) * grows > 0.0 if grows else value == values[name]


@pytest.mark.parametrize(
    "spec", ["actuation_delay", "mocap_latency", "mocap_latency_smoothed", "speed_lag_and_steering_backlash"]
)
def test_how_time_is_split_does_not_matter(spec):
    fine, coarse = (poses(as_drawn(spec)(4), ROUTE, dt=dt) for dt in (0.02, 0.1))
    odd = as_drawn(spec)(4)
    odd.reset(START, seed=1)
    for duration, share, front, rear in ROUTE:
        command = (1500.0 - 600.0 * share, 1500.0 + front / -1.4e-3, 1500.0 + rear / -1.4e-3)
        for dt in (0.31 * duration, 0.0, 0.69 * duration):
            last = odd.advance(*command, dt)
    np.testing.assert_allclose(fine[4::5], coarse, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(last, fine[-1], rtol=0.0, atol=1e-6)


def test_runs_differ_by_little_play_that_their_seeds_draw():
    plant, ends = as_drawn(NOTHING)(1), []
    for seed in (1, 2, 1):
        plant.reset(START, seed=seed)
        ends.append(plant.advance(900.0, 1300.0, 1700.0, 4.0))
    assert ends[0] == ends[2]
    assert 0.0 < math.dist(ends[0][:2], ends[1][:2]) < 0.02


def test_all_plants_of_a_seed_are_one_vehicle():
    hiding = [as_drawn(spec)(7).sealed_truth().constants for spec in (NOTHING, "floor_tilt", "slow_patch")]
    assert all(hiding[0].items() <= other.items() for other in hiding[1:])


def test_truth_says_what_is_hidden():
    truth = as_drawn("lateral_slip_linear_and_slow_patch")(3).sealed_truth()
    assert truth.kind == "two"
    assert truth.library_names == ("lateral_slip",)
    assert [effect.kind for effect in truth.effects] == ["other form", "outside"]
    assert truth.effects[1].covariates[0] == "x_m"
    assert as_drawn(NOTHING)(3).sealed_truth().kind == "nothing"


def test_what_loads_plants_for_a_bench_does_not_hand_out_the_truth():
    plant = load_plant("agvbench.simulator.hidden:nothing")(1)
    assert not hasattr(plant, "sealed_truth")
    assert plant.true_state() == {}


@pytest.mark.parametrize("wrong", ["steering_leg", "steering_lag_and_", "steering_lag_and_steering_lag"])
def test_unknown_names_are_told_in_one_line(wrong):
    with pytest.raises(PlantError, match="has no"):
        load_plant(f"agvbench.simulator.hidden:{wrong}")(1)
    with pytest.raises(PlantError, match=r"no such hidden effect|hidden twice"):
        recipes(wrong)


def test_misspelt_name_is_corrected():
    with pytest.raises(PlantError, match="did you mean 'steering_lag'"):
        load_plant("agvbench.simulator.hidden:steering_lg")


def test_seeds_draw_nothing_one_and_two():
    specs = [drawing.sampled_spec(seed) for seed in range(400)]
    nothing, pairs = specs.count(NOTHING), sum("_and_" in spec for spec in specs)
    assert 50 < nothing < 110
    assert 50 < pairs < 110
    # Plants of published seeds stay as they are.
    later = {"wheelbase_error", "axle_differential"}
    constant = {name for name, recipe in CATALOGUE.items() if not recipe.changes} - later
    assert {name for spec in specs if spec != NOTHING for name in spec.split("_and_")} == constant
    nothing_seed = specs.index(NOTHING)
    assert make_plant(nothing_seed).sealed_truth().kind == "nothing"


def test_constants_lie_where_their_names_say():
    for index, name in enumerate(constants.NAMES):
        assert getattr(constants, name.upper()) == index


def test_catalogue_has_the_whole_library_other_forms_and_eight_outside():
    kinds = [recipe.kind for recipe in CATALOGUE.values()]
    assert kinds.count("library") == 22
    assert kinds.count("other form") >= 5
    assert kinds.count("outside") >= 8
    library = {recipe.name for recipe in CATALOGUE.values() if recipe.kind == "library"}
    assert {recipe.library_name for recipe in CATALOGUE.values() if recipe.kind == "other form"} <= library
