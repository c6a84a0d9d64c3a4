"""Priors in vehicle files: exact round trips, one clear line for every mistake, and no change of the physics."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from agvbench.effects.variants import effect_variants, weights_in
from agvbench.errors import VehicleError
from agvbench.model import VehicleModel, thesis_vehicle
from agvbench.model.priors import Prior
from agvbench.model.toml import vehicle_to_toml

LATENCY = Prior("mocap_latency", "latency_s", 0.008, 0.001, "data sheet")
BRAKING = Prior("speed_lag", "brake_s", 0.3, 0.05, "stop watch")
RATE = Prior("steering_rate_limit", "rate_rad_per_s", 7.0, 1.5, "data sheet of the servo")
STATED = {"value": 0.008, "standard_deviation": 0.001, "source": "data sheet"}


def test_priors_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    model = replace(thesis_vehicle(), priors=(LATENCY, BRAKING, RATE))
    model.save(tmp_path / "a.toml")
    again = VehicleModel.load(tmp_path / "a.toml")
    again.save(tmp_path / "b.toml")
    assert again == model
    assert "[priors.mocap_latency.latency_s]" in (tmp_path / "a.toml").read_text()
    assert (tmp_path / "a.toml").read_bytes() == (tmp_path / "b.toml").read_bytes()


def test_priors_are_no_part_of_the_physics() -> None:
    model = thesis_vehicle()
    stated = replace(model, priors=(LATENCY,))
    assert stated.calibration_hash == model.calibration_hash
    assert stated.effects == ()
    assert "priors" not in vehicle_to_toml(model)


def test_a_prior_may_be_given_once() -> None:
    with pytest.raises(VehicleError, match=r"priors: a prior may be given once: mocap_latency.latency_s"):
        replace(thesis_vehicle(), priors=(LATENCY, LATENCY))


MISTAKES: dict[str, tuple[Any, str]] = {
    "a number": (3, "priors: must be a table: 3"),
    "a number for an effect": (
        {"mocap_latency": 0.008},
        "priors.mocap_latency: must be a table: 0.008; write [priors.mocap_latency]",
    ),
    "a number for a parameter": (
        {"mocap_latency": {"latency_s": 0.008}},
        "priors.mocap_latency.latency_s: must be a table: 0.008; write [priors.mocap_latency.latency_s]",
    ),
    "unknown effect": (
        {"mocap_latancy": {"latency_s": STATED}},
        "priors: unknown effect: 'mocap_latancy'; did you mean mocap_latency?",
    ),
    "a variant": (
        {"mocap_latency_smoothing": {"latency_s": STATED}},
        (
            "priors: a variant has no prior of its own: mocap_latency_smoothing; write the prior of mocap_latency, "
            "which holds for its variants"
        ),
    ),
    "unknown parameter": (
        {"mocap_latency": {"delay_s": STATED}},
        "priors.mocap_latency: unknown parameter: 'delay_s'; did you mean latency_s?",
    ),
    "a direction": (
        {"floor_tilt": {"direction_rad": STATED}},
        (
            "priors.floor_tilt: a direction has no null value, and no prior: direction_rad; "
            "write the prior of the size only"
        ),
    ),
    "no source": (
        {"mocap_latency": {"latency_s": {"value": 0.0, "standard_deviation": 0.001}}},
        "priors.mocap_latency.latency_s: a key is missing: source; add source = …",
    ),
    "an empty source": (
        {"mocap_latency": {"latency_s": STATED | {"source": " "}}},
        "priors.mocap_latency.latency_s.source: must not be empty: ' '; name the document or the measurement",
    ),
    "unknown key": (
        {"mocap_latency": {"latency_s": STATED | {"sd": 0.1}}},
        "priors.mocap_latency.latency_s: unknown key: sd; known keys: value, standard_deviation, source",
    ),
    "an effect inside": (
        {"mocap_latency": {"latency_s": STATED | {"effect": "steering_lag"}}},
        "priors.mocap_latency.latency_s: unknown key: effect; known keys: value, standard_deviation, source",
    ),
    "no deviation": (
        {"mocap_latency": {"latency_s": STATED | {"standard_deviation": 0.0}}},
        "priors.mocap_latency.latency_s.standard_deviation: must be greater than zero: 0.0",
    ),
    "infinite deviation": (
        {"mocap_latency": {"latency_s": STATED | {"standard_deviation": math.inf}}},
        "priors.mocap_latency.latency_s.standard_deviation: must be a finite number: inf",
    ),
    "a text": (
        {"mocap_latency": {"latency_s": STATED | {"value": "8 ms"}}},
        "priors.mocap_latency.latency_s.value: must be a number: '8 ms'",
    ),
    "milliseconds": (
        {"mocap_latency": {"latency_s": STATED | {"value": 8.0}}},
        "priors.mocap_latency.latency_s.value: is out of bounds: 8 s (limit: -0.5 … 2 s)",
    ),
    "an infinite limit": (
        {"steering_rate_limit": {"rate_rad_per_s": STATED | {"value": math.inf}}},
        "priors.steering_rate_limit.rate_rad_per_s.value: must be a finite number: inf",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_in_one_line(mistake: str, tmp_path: Path) -> None:
    priors, message = MISTAKES[mistake]
    content = copy.deepcopy(vehicle_to_toml(thesis_vehicle())) | {"priors": priors}
    path = tmp_path / "vehicle.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    with pytest.raises(VehicleError) as caught:
        VehicleModel.load(path)
    assert str(caught.value) == f"{path}: {message}"


def test_equivalents_of_variants_are_parameters_of_both() -> None:
    for name, variant in effect_variants().items():
        for quantity, weights in variant.equivalents.items():
            effect, _, parameter = quantity.partition(".")
            Prior(effect, parameter, 0.0, 1.0, "test")
            assert set(weights) <= {p.name for p in variant.parameters()}
            assert weights_in(name, quantity) == weights


@pytest.mark.parametrize("name", ["actuation_delay_servos", "actuation_delay_uneven"])
def test_a_variant_that_equals_the_library_has_the_same_quantity(name: str) -> None:
    variant = effect_variants()[name](*[0.03] * len(effect_variants()[name].parameters()))
    weights = weights_in(name, "actuation_delay.delay_s")
    assert sum(weight * variant.values[key] for key, weight in weights.items()) == pytest.approx(0.03)
