"""Hidden differential vehicles: what they can hide, and their equations; those of two axles stay what they were."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from agvbench.diagnosis.selection.candidates import applies
from agvbench.effects import effect_kinds
from agvbench.errors import PlantError
from agvbench.simulator import check_plant, load_plant
from agvbench.simulator.hidden import SealedTruth, make_hidden_plant, sealed_truth, vehicle_of
from agvbench.simulator.hidden.catalogue import CATALOGUE, NOTHING, catalogue, recipes
from agvbench.simulator.hidden.constants import NULL
from agvbench.simulator.hidden.plant import HiddenPlant
from agvbench.simulator.hidden.recipe import Recipe
from agvbench.vehicle.geometry import Geometry

HIDDEN = catalogue("differential")
GEOMETRY = {
    "two_axle": Geometry(front_axle_m=0.181, rear_axle_m=0.121),
    "differential": Geometry(front_axle_m=0.0, rear_axle_m=0.05, kinematics="differential"),
}
BASE = vehicle_of(7, "differential").constants | {"drive_dead": 0.0}
START = (0.3, -0.2, 0.7)
ROUTE = [(0.5, 0.0, 0.0), (2.0, 0.3, 0.6), (1.5, 0.0, -1.0), (2.0, -0.2, 0.4), (1.0, 0.0, 0.0)]
"""Duration [s], speed [m/s] and yaw rate [rad/s]."""


def quiet(**constants: float) -> HiddenPlant:
    """A plant without play."""
    return HiddenPlant(BASE | constants, (0.0, 0.0, 0.0), 0, SealedTruth("nothing"))


def poses(plant: HiddenPlant, dt: float = 0.02) -> np.ndarray:
    plant.reset(START, seed=1)
    return np.array([plant.advance(v, w, 0.0, dt) for s, v, w in ROUTE for _ in range(round(s / dt))])


@pytest.mark.parametrize("kinematics", GEOMETRY)
def test_what_can_be_hidden_is_what_the_library_has_for_such_a_vehicle(kinematics: str) -> None:
    can = {name for name, kind in effect_kinds().items() if applies(kind, GEOMETRY[kinematics])}
    assert {r.library_name for r in catalogue(kinematics).values() if r.library_name} == can


def test_there_are_causes_of_every_kind() -> None:
    kinds = [recipe.kind for recipe in HIDDEN.values()]
    assert kinds.count("library") >= 14
    assert kinds.count("other form") >= 5
    assert kinds.count("outside") >= 10


def test_a_differential_vehicle_cannot_have_what_needs_axles() -> None:
    with pytest.raises(PlantError, match="no such hidden effect"):
        recipes("axle_coupling", "differential")
    with pytest.raises(PlantError, match="no such hidden effect"):
        recipes("wheel_lag")


@pytest.mark.parametrize("spec", [NOTHING, *HIDDEN])
def test_keeps_the_plant_contract(spec: str) -> None:
    check_plant(
        lambda seed: make_hidden_plant(spec, seed, floors=0.0, kinematics="differential"), command_unit="normalised"
    )


def test_the_command_line_loads_it() -> None:
    plant = load_plant("agvbench.simulator.hidden.differential:speed_lag_and_slow_patch")(seed=3)
    assert plant.advance(0.3, 0.0, 0.0, 1.0)[0] > 0.1
    with pytest.raises(PlantError, match="did you mean 'wheel_lag'"):
        load_plant("agvbench.simulator.hidden.differential:wheel_leg")


def sizes(recipe: Recipe, *, null: bool) -> dict[str, float]:
    values = recipe.draw(np.random.default_rng(1))
    if not null:
        return recipe.constants(values)
    grown = recipe.constants({k: {1: 0.0, -1: math.inf, 0: v}[recipe.sizes[k].grows] for k, v in values.items()})
    # An infinite frequency is one that is not there.
    return {k: NULL[k] if k.endswith("frequency") else v for k, v in grown.items()}


@pytest.mark.parametrize("name", HIDDEN)
def test_null_size_is_the_base_plant_and_a_drawn_one_is_not(name: str) -> None:
    null = sizes(HIDDEN[name], null=True) | ({"stick_s": 0.0} if name == "stick_slip" else {})
    assert np.array_equal(poses(quiet(**null)), poses(quiet()))
    if name not in {"drive_dead_band", "slow_patch", "floor_seam"}:  # which this route does not meet
        assert not np.array_equal(poses(quiet(**sizes(HIDDEN[name], null=False))), poses(quiet()))


def truth(lag: tuple[float, float] = (0.0, 0.0), slip: float = 0.0, bend: float = 0.0) -> np.ndarray:
    """The poses of the markers every 20 ms: two wheels, each with a lag of first order, by DOP853.

    The wheels' speeds are states here, where the plant has those of the body. `lag` is that of the wheels and of
    nothing else; a lag of zero is a wheel that follows at once.
    """
    track, ahead, rows, begin = BASE["track"], BASE["rear_axle"], [], 0.0
    state = np.array([START[0] - ahead * math.cos(START[2]), START[1] - ahead * math.sin(START[2]), START[2], 0.0, 0.0])
    for duration, v, w in ROUTE:
        gain = BASE["gain_forward"] if v > 0.0 else BASE["gain_backward"]
        aim_v, aim_w = gain * v, BASE["front_slope"] * w
        aims = np.array([aim_v - 0.5 * track * aim_w, aim_v + 0.5 * track * aim_w])

        def rates(_: float, s: np.ndarray, aims: np.ndarray = aims) -> list[float]:
            left, right = s[3:] if lag[0] else aims
            speed, turn = 0.5 * (left + right), (right - left) / track
            turn = turn / (1.0 + slip * speed**2) + bend * speed
            gained = (aims - s[3:]) / lag[0] if lag[0] else (0.0, 0.0)
            return [speed * math.cos(s[2]), speed * math.sin(s[2]), turn, *gained]

        times = begin + 0.02 * np.arange(1, round(duration / 0.02) + 1)
        found = solve_ivp(rates, (begin, times[-1] + 1e-9), state, "DOP853", t_eval=times, rtol=1e-10, atol=1e-12)
        rows.append(found.y.T)
        state, begin = found.y[:, -1], begin + duration
    x, y, heading = np.concatenate(rows)[:, :3].T
    return np.column_stack([x + ahead * np.cos(heading), y + ahead * np.sin(heading), heading])


@pytest.mark.parametrize(
    ("constants", "wanted"),
    [
        ({}, {}),
        ({"slip_square": 1.3}, {"slip": 1.3}),
        ({"wheel_curvature": -0.08}, {"bend": -0.08}),
        ({"lag_s": 0.2, "accelerate_s": 0.2, "brake_s": 0.2}, {"lag": (0.2, 0.2)}),
    ],
)
def test_it_is_driven_by_two_wheels(constants: dict[str, float], wanted: dict[str, object]) -> None:
    assert np.abs(poses(quiet(**constants)) - truth(**wanted)).max() < 2e-5


def test_motors_of_second_order_have_the_step_response_of_their_equation() -> None:
    plant, omega, damping = quiet(drive_frequency=10.0, drive_damping=0.8), 10.0, 0.8
    plant.reset((0.0, 0.0, 0.0), seed=1)
    found = np.array([plant.advance(0.3, 0.0, 0.0, 0.02)[0] for _ in range(60)])
    t = 0.02 * np.arange(1, 61)
    aim, own = BASE["gain_forward"] * 0.3, omega * math.sqrt(1.0 - damping**2)
    # The integral of 1 − e^(−ζωt) (cos ω_d t + ζω/ω_d sin ω_d t).
    decay = np.exp(-damping * omega * t)
    lost = (2.0 * damping / omega) * (1.0 - decay * np.cos(own * t))
    lost += (1.0 - 2.0 * damping**2) / own * decay * np.sin(own * t)
    assert np.abs(found - aim * (t - lost)).max() < 2e-6


def test_tyres_that_scrub_let_a_vehicle_turn_late_and_then_as_it_is_told() -> None:
    """While it stands the integral part grows by the command over its time; then the rest decays with that time."""
    friction, integral_s, aim = 1.2, 2.0, abs(BASE["front_slope"] * 1.0)
    assert aim < friction
    plant = quiet(scrub=friction, scrub_integral_s=integral_s)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    found = np.array([abs(plant.advance(0.0, 1.0, 0.0, 0.02)[2]) for _ in range(300)])
    turning_s = np.maximum(0.02 * np.arange(1, 301) - integral_s * (friction - aim) / aim, 0.0)
    wanted = aim * (turning_s + integral_s * np.expm1(-turning_s / integral_s))
    assert np.abs(found - wanted).max() < 2e-3


def test_a_battery_of_wheels_slows_turns_as_well_as_straights() -> None:
    turned = []
    for constants in ({}, {"droop": 0.5, "turn_droop": 0.5}, {"droop": 0.5}):
        plant = HiddenPlant(BASE | constants, (0.0, 0.0, 0.0), 0, SealedTruth("nothing"), turnaround_s=3600.0)
        plant.advance(0.0, 0.0, 0.0, 0.01)
        plant.reset((0.0, 0.0, 0.0), seed=1)
        turned.append(plant.advance(0.0, 1.0, 0.0, 2.0)[2])
    assert turned[1] == pytest.approx(0.5 * turned[0], rel=1e-3)
    assert turned[2] == turned[0]


def test_a_caster_turns_a_vehicle_that_leaves_backward_by_its_kick() -> None:
    headings = []
    for v in (0.3, -0.3):
        plant = quiet(caster_kick=0.06, caster_trail=0.02)
        plant.reset((0.0, 0.0, 0.0), seed=1)
        headings.append(plant.advance(v, 0.0, 0.0, 3.0)[2])
    # It begins 0.3 rad aside, and comes about by what is left of half a turn.
    assert headings[1] == pytest.approx(0.06 * (math.pi - 0.3) / math.pi, rel=0.03)
    assert headings[0] == pytest.approx(-0.06 * 0.3 / math.pi, rel=0.03)


@pytest.mark.slow
def test_sizes_are_drawn_to_be_found() -> None:
    for name in ("wheel_lag", "motor_asymmetry", "caster_swivel", "heading_misalignment"):
        assert sealed_truth(name, 301, "differential").separation >= 3.0


# Before there were differential vehicles.
@pytest.mark.parametrize(
    ("spec", "pose"),
    [
        ("nothing", ("0x1.78669b284ae3ap-2", "-0x1.5c321286ee48fp-2", "0x1.af60da51d6989p+0")),
        ("steering_lag_and_lateral_slip", ("0x1.009eae7916288p-2", "-0x1.26b0c0baeb20fp-2", "0x1.1497d851bbeefp+0")),
        ("speed_lag_ramp", ("0x1.af64ea452bb72p-2", "-0x1.2a12dd5ecd46fp-4", "0x1.e3d794ec8c011p-1")),
        ("wheel_runout", ("0x1.6593527229608p-2", "-0x1.53dd622f595b6p-2", "0x1.a3425b4e0ca2fp+0")),
        ("speed_sag_and_battery_droop", ("0x1.76292e97f20dfp-2", "-0x1.53d11bdba04e1p-2", "0x1.ab2bacb04697dp+0")),
    ],
)
def test_vehicles_with_two_axles_are_what_they_were(spec: str, pose: tuple[str, str, str]) -> None:
    plant = make_hidden_plant(spec, 210, floors=0.0)
    plant.reset(START, seed=4)
    found = (0.0, 0.0, 0.0)
    for command in ((900.0, 1300.0, 1650.0, 0.8), (2100.0, 1700.0, 1500.0, 1.1), (1500.0, 1500.0, 1500.0, 0.5)):
        found = plant.advance(*command)
    # Mathematical libraries differ in the last digit.
    assert found == pytest.approx([float.fromhex(number) for number in pose], rel=1e-12, abs=0.0)
    assert "wheel_lag" not in CATALOGUE
