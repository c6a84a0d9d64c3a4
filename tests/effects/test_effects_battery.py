"""What holds for every effect: a new file in the package is tested here without another line."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import agvbench.effects as effects_package
from agvbench.effects import Effect, Stage, effect_from_toml, effect_kinds
from agvbench.errors import VehicleError

KINDS = effect_kinds()
each_effect = pytest.mark.parametrize("cls", KINDS.values(), ids=KINDS.keys())


def test_every_file_of_the_package_adds_an_effect() -> None:
    files = {path.stem for path in Path(effects_package.__file__).parent.glob("*.py")}
    assert files - {"__init__", "base", "registry", "state"} == set(KINDS)
    assert {"actuation_delay", "steering_lag", "speed_lag"} <= set(KINDS)


@each_effect
def test_declares_where_it_acts_and_what_it_relaxes(cls: type[Effect]) -> None:
    assert isinstance(cls.stage, Stage)
    assert cls.relaxes
    assert cls.reference
    assert cls.__doc__
    assert cls.parameters()


@each_effect
def test_without_arguments_it_does_nothing(cls: type[Effect]) -> None:
    assert cls().is_null
    assert cls().values == {p.name: p.null for p in cls.parameters()}
    for p in cls.parameters():
        inside = p.low + 0.25 * (p.high - p.low)
        assert not cls(**{p.name: inside}).is_null


@each_effect
@given(share=st.floats(0.0, 1.0))
def test_toml_round_trip_is_exact(cls: type[Effect], share: float) -> None:
    effect = cls(**{p.name: p.low + share * (p.high - p.low) for p in cls.parameters()})
    assert effect_from_toml(tomllib.loads(tomli_w.dumps(effect.to_toml()))) == effect


@each_effect
def test_values_out_of_bounds_are_refused(cls: type[Effect]) -> None:
    for p in cls.parameters():
        for bad in (p.high + 1.0, p.low - 1.0, math.nan, "much", True):
            with pytest.raises(VehicleError, match=rf"^effects\[0\]\.{p.name}: (is out of bounds|must be)") as caught:
                effect_from_toml({"name": cls.name, p.name: bad}, where="effects[0]")
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "effect: a key is missing: name"),
        ({"name": "gremlins"}, "effect.name: unknown effect: 'gremlins' (limit: actuation_delay, "),
        ({"name": "steering_lag", "time_constant": 0.1}, "effect: unknown key: time_constant; did you mean time_const"),
        ("steering_lag", "effect: must be a table"),
    ],
)
def test_registry_errors(table: object, message: str) -> None:
    with pytest.raises(VehicleError) as caught:
        effect_from_toml(table)
    assert str(caught.value).startswith(message)


def test_names_and_parameters_are_the_contract() -> None:
    declared = {name: [p.name for p in cls.parameters()] for name, cls in KINDS.items()}
    assert declared["actuation_delay"] == ["delay_s"]
    assert declared["steering_lag"] == ["time_constant_s"]
    assert declared["speed_lag"] == ["accelerate_s", "brake_s"]
