"""Other laws of a cause: sound, nothing at null, kept by vehicle files, and the library's where they should be."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from effect_checks import check_form, check_null_hooks

from agvbench.effects import effect_from_toml, effect_kinds
from agvbench.effects.ground.cornering_speed_loss import CorneringSpeedLoss
from agvbench.effects.ground.lateral_slip import LateralSlip
from agvbench.effects.variants import Variant, effect_variants
from agvbench.model import VehicleModel, example_vehicle
from agvbench.types import Commands

FORMS = effect_variants()
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS.keys())
STEPS = np.array([0.0, 1.0, 2.5, 4.0])
COMMANDS = Commands(STEPS, np.array([900.0, 900.0, 1100.0, 1500.0]), np.array([1300.0, 1750.0, 1250.0, 1500.0]), np.array([1600.0, 1500.0, 1500.0, 1500.0]))  # fmt: skip  # noqa: E501
TIMES = np.linspace(0.0, 5.0, 60)


ROBOT_COMMANDS = Commands(STEPS, np.array([0.3, 0.3, -0.2, 0.0]), np.array([0.5, -0.8, 0.4, 0.0]), np.zeros(4))


def drive(*effects, vehicle="thesis"):
    model = example_vehicle(vehicle).with_effects(*effects)
    commands = COMMANDS if vehicle == "thesis" else ROBOT_COMMANDS
    return model.rollout([commands], np.array([[0.1, -0.2, 0.3]]), [TIMES], [0.5])[0]


def kind_of(form: type[Variant]) -> str:
    return "differential" if form.needs_differential else "thesis"


@each_form
def test_it_is_declared_as_an_effect_is(form: type[Variant]) -> None:
    check_form(form)
    check_null_hooks(form)
    assert form.variant_of in effect_kinds()
    assert form.name not in effect_kinds()


@each_form
def test_a_vehicle_file_keeps_it_and_drives_with_it(form: type[Variant], tmp_path: Path) -> None:
    effect = form(**{p.name: p.scale for p in form.parameters()})
    assert effect_from_toml(tomllib.loads(tomli_w.dumps(effect.to_toml()))) == effect
    example_vehicle(kind_of(form)).with_effects(effect).save(tmp_path / "vehicle.toml")
    loaded = VehicleModel.load(tmp_path / "vehicle.toml")
    assert loaded.effects == (effect,)
    moved = drive(effect, vehicle=kind_of(form)) - drive(vehicle=kind_of(form))
    assert np.hypot(moved[:, 0], moved[:, 1]).max() > 1e-3


@each_form
def test_starts_lie_within_bounds(form: type[Variant]) -> None:
    library = effect_kinds()[form.variant_of]
    starts = form.starts({p.name: p.scale for p in library.parameters()})
    low, high = ([getattr(p, side) for p in form.parameters()] for side in ("low", "high"))
    assert np.all((np.array(starts) >= low) & (np.array(starts) <= high))


def test_at_the_librarys_exponent_a_power_is_the_librarys_law() -> None:
    slip = FORMS["lateral_slip_power"](loss=0.8 * 0.09, exponent=2.0)
    np.testing.assert_allclose(drive(slip), drive(LateralSlip(0.8)), atol=1e-6)
    loss = FORMS["cornering_speed_loss_power"](loss=0.1, exponent=1.0)
    np.testing.assert_allclose(drive(loss), drive(CorneringSpeedLoss(0.1)), atol=1e-6)


@each_form
def test_at_null_it_leaves_the_librarys_law_alone(form: type[Variant]) -> None:
    library = effect_kinds()[form.variant_of]
    effect = library(**{p.name: p.scale for p in library.parameters()})
    # Hardly anything, but in the simulation that has all laws.
    laws = {law.name: law for law in (form(), FORMS["lateral_slip_power"](loss=1e-12))}
    vehicle = kind_of(form)
    np.testing.assert_allclose(
        drive(effect, *laws.values(), vehicle=vehicle), drive(effect, vehicle=vehicle), atol=1e-6
    )
