"""Options of a plant: keyword arguments of its factory, in the types that it declares."""

from __future__ import annotations

import inspect

import pytest

from agvbench.errors import FlagError, PlantError
from agvbench.simulator import load_plant
from agvbench.simulator.plant_options import plant_keywords
from agvbench.simulator.plant_parameters import DIFFERENTIAL, TWO_AXLES
from agvbench.simulator.plants import PLANTS


def declared(
    seed: int, *, gain: float = 1.0, wheels: int = 4, kind: str = "car", wet: bool = False, grip: float | None = None
) -> None:
    """Declare a parameter of every type."""


def undeclared(seed, share=0.5, label="a", anything=None):
    """Declare types by defaults only."""


def needs(seed, *, mass_kg: float):
    """Need an option."""


def test_each_value_has_the_type_that_the_factory_declares():
    given = {"gain": "0.5", "wheels": "6", "kind": "1", "wet": "true", "grip": "2"}
    assert plant_keywords(declared, given, "p") == {"gain": 0.5, "wheels": 6, "kind": "1", "wet": True, "grip": 2.0}


def test_without_annotations_defaults_or_the_value_itself_say_the_type():
    given = {"share": "1", "label": "2", "anything": "3"}
    assert plant_keywords(undeclared, given, "p") == {"share": 1.0, "label": "2", "anything": 3.0}
    assert plant_keywords(undeclared, {"anything": "ice"}, "p") == {"anything": "ice"}


NOT_ONE = "not an option of p"
KNOWN = "one of: gain, wheels, kind, wet, grip"


@pytest.mark.parametrize(
    ("factory", "given", "line"),
    [
        (declared, {"gian": "1"}, f"{NOT_ONE}: 'gian' ({KNOWN}); did you mean 'gain'?"),
        (declared, {"seed": "1"}, f"{NOT_ONE}: 'seed' ({KNOWN}); leave it out"),
        (declared, {"gain": "much"}, "gain cannot have this value: 'much' (limit: a number)"),
        (declared, {"gain": "nan"}, "gain cannot have this value: 'nan' (limit: a number)"),
        (declared, {"wheels": "4.5"}, "wheels cannot have this value: '4.5' (limit: a whole number)"),
        (declared, {"wet": "maybe"}, "wet cannot have this value: 'maybe' (limit: true or false)"),
        (needs, {}, "p needs an option: mass_kg; add mass_kg=VALUE"),
        (lambda _: None, {"gain": "1"}, f"{NOT_ONE}: 'gain' (limit: it has none); leave it out"),
    ],
)  # fmt: skip
def test_what_a_factory_does_not_take_is_one_line(factory, given, line):
    with pytest.raises(FlagError) as caught:
        plant_keywords(factory, given, "p")
    assert str(caught.value) == f"--plant-option: {line}"


@pytest.mark.parametrize("name", PLANTS)
def test_every_parameter_of_a_plant_that_ships_changes_what_it_drives_and_its_range_is_checked(name):
    table = DIFFERENTIAL if "differential" in name else TWO_AXLES
    assert list(inspect.signature(PLANTS[name]).parameters) == ["seed", *table]
    for parameter, known in table.items():
        vehicles = [PLANTS[name](3, **{parameter: value}).vehicle for value in (known.low, known.high)]
        assert vehicles[0] != vehicles[1]
        with pytest.raises(PlantError, match=f"parameter is out of range.*limit: {known.low:g} to {known.high:g}"):
            PLANTS[name](3, **{parameter: known.high + 1.0})
    assert PLANTS[name](3, **dict.fromkeys(table)).vehicle == PLANTS[name](3).vehicle


def test_an_option_reaches_the_plant_that_is_driven():
    route = [(900.0, 1500.0, 1500.0, 3.0), (900.0, 1300.0, 1500.0, 3.0)]
    ends = []
    for options in ({}, {"understeer_s2_per_m2": "0.5"}, {"understeer_s2_per_m2": "0"}):
        plant = load_plant("agvbench.simulator:make_plant", options)(0)
        plant.reset((0.0, 0.0, 0.0), seed=1)
        ends.append([plant.advance(*command) for command in route][-1])
    assert ends[0] == ends[2]
    assert abs(ends[0][2] - ends[1][2]) > 0.01
