"""What holds for every effect: a new file in the package is tested here without another line."""

from __future__ import annotations

import importlib.util
import math
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from effect_checks import check_form, check_null_hooks
from hypothesis import given
from hypothesis import strategies as st

import agvbench.effects as effects_package
from agvbench.effects import HOOKS, Effect, effect_from_toml, effect_kinds
from agvbench.effects.declaration import check_declaration
from agvbench.effects.variants import effect_variants
from agvbench.errors import VehicleError
from agvbench.model import VehicleModel, example_vehicle
from agvbench.model.simulation.hook_errors import check_hooks
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.registry import own_classes
from agvbench.reporting.console.effects import reference_page
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry
from agvbench.workflows.effects import template_text

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

KINDS = effect_kinds()
each_effect = pytest.mark.parametrize("cls", KINDS.values(), ids=KINDS.keys())
CONTRACT = {
    "actuation_delay": ["delay_s"],
    "steering_lag": ["time_constant_s"],
    "steering_rate_limit": ["rate_rad_per_s"],
    "steering_backlash": ["width_rad"],
    "steering_saturation": ["front_rad", "rear_rad"],
    "axle_coupling": ["front_from_rear", "rear_from_front"],
    "reverse_steering_gain": ["gain"],
    "speed_lag": ["accelerate_s", "brake_s"],
    "drive_dead_band": ["width"],
    "cornering_speed_loss": ["loss"],
    "battery_droop": ["per_hour"],
    "lateral_slip": ["gradient"],
    "wheel_diameter_mismatch": ["curvature_per_m"],
    "axle_speed_mismatch": ["ratio"],
    "axle_overrun": ["excess"],
    "floor_tilt": ["drift_mps", "direction_rad"],
    "mocap_latency": ["latency_s"],
    "marker_offset": ["forward_m", "left_m"],
    "heading_misalignment": ["angle_rad"],
    "mocap_scale": ["scale"],
    "wheelbase_error": ["longer"],
}
# Forward through changing turns, backward, stop; both axles beyond the typical size of an end stop.
TIMES = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
ROWS = np.array([[0, 0, 0], [0.7, -0.2, 0.3], [-0.4, 0.7, 0.3], [0.5, 0.2, -0.3], [-0.5, -0.7, -0.3], [0, 0, 0.0]])
COMMANDS = Commands(TIMES, 1500.0 + 300.0 * np.sign(ROWS[1:, 2]), np.full(5, 1500.0), np.full(5, 1500.0))
RUN = SimulatedRun(COMMANDS, np.linspace(-0.5, 5.0, 80), started_h=1.0)
INITIAL = np.array([[0.5, 0.2, 0.3, 0.0]])


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(Geometry(0.18, 0.12), NEUTRAL, [RUN])


def test_every_file_of_the_package_adds_an_effect_or_a_variant() -> None:
    files = {path.stem for path in Path(effects_package.__file__).parent.rglob("*.py")}
    shared = {"__init__", "base", "declaration", "registry", "state", "variants"}
    assert files - shared == {*KINDS, *effect_variants()}


def test_names_and_parameters_are_the_contract() -> None:
    declared = {name: [p.name for p in cls.parameters()] for name, cls in KINDS.items()}
    assert {name: declared[name] for name in CONTRACT} == CONTRACT


@each_effect
def test_form(cls: type[Effect]) -> None:
    check_declaration(cls)
    check_form(cls)


@each_effect
def test_it_says_what_to_do_in_the_workshop(cls: type[Effect]) -> None:
    assert len(cls.remedy.split()) > 5
    assert not cls.remedy.endswith((".", " "))


@each_effect
def test_without_arguments_it_does_nothing(cls: type[Effect]) -> None:
    assert cls().is_null
    assert cls().values == {p.name: p.null for p in cls.parameters()}
    for p in cls.parameters():
        inside = p.low + 0.3 * (p.high - p.low)
        assert not cls(**{p.name: inside}).is_null
    check_null_hooks(cls)


@each_effect
def test_vanishes_towards_null(simulation: Simulation, cls: type[Effect]) -> None:
    nothing = simulation.predict(ROWS, simulation.parameters(), INITIAL)
    moved = []
    for share in (1e-2, 1e-3, 1e-4):
        towards = simulation.parameters()
        for i in simulation.indices(cls.name):
            scale, null = simulation.scales[i], simulation.nulls[i]
            towards[i] = scale / share if math.isinf(null) else null + share * scale
        moved.append(np.abs(simulation.predict(ROWS, towards, INITIAL) - nothing).max())
    assert moved[2] <= 0.2 * moved[1] <= 0.04 * moved[0] or moved[0] < 1e-9
    assert moved[2] < 1e-3


@each_effect
def test_every_parameter_moves_the_prediction(simulation: Simulation, cls: type[Effect]) -> None:
    typical = {p.name: p.scale for p in cls.parameters()}
    here = simulation.predict(ROWS, _vector(simulation, cls, typical), INITIAL)
    for p in cls.parameters():
        changed = _vector(simulation, cls, {**typical, p.name: 0.8 * p.scale})
        assert np.abs(simulation.predict(ROWS, changed, INITIAL) - here).max() > 1e-4


@each_effect
def test_the_start_is_what_the_camera_sees(simulation: Simulation, cls: type[Effect]) -> None:
    typical = _vector(simulation, cls, {p.name: p.scale for p in cls.parameters()})
    poses = simulation.predict(ROWS, typical, INITIAL)
    np.testing.assert_allclose(poses[0], INITIAL[0, :3], atol=1e-12)


@each_effect
@given(share=st.floats(0.0, 1.0))
def test_toml_round_trip_is_exact(cls: type[Effect], share: float) -> None:
    effect = cls(**{p.name: p.low + share * (p.high - p.low) for p in cls.parameters()})
    assert effect_from_toml(tomllib.loads(tomli_w.dumps(effect.to_toml()))) == effect


@each_effect
def test_a_vehicle_file_keeps_it(cls: type[Effect], tmp_path: Path) -> None:
    effect = cls(**{p.name: p.scale for p in cls.parameters()})
    before = example_vehicle("differential" if cls.needs_differential else "thesis")
    model = before.with_effects(effect)
    model.save(tmp_path / "vehicle.toml")
    loaded = VehicleModel.load(tmp_path / "vehicle.toml")
    assert loaded == model
    assert loaded.calibration_hash != before.calibration_hash


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
        ({"name": "gremlins"}, "effect.name: unknown effect: 'gremlins' (one of: actuation_delay, "),
        ({"name": "steering_lag", "time_constant": 0.1}, "effect: unknown key: time_constant; did you mean time_const"),
        ("steering_lag", "effect: must be a table"),
    ],
)
def test_registry_errors(table: object, message: str) -> None:
    with pytest.raises(VehicleError) as caught:
        effect_from_toml(table)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("hook", HOOKS)
def test_the_template_passes_the_checks_of_form(hook: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"servo_warm_up_{hook}.py"
    path.write_text(template_text(path.stem, hook), encoding="utf-8")
    monkeypatch.setitem(sys.modules, path.stem, None)  # removed again at the end
    cls = next(cls for cls in own_classes(load(path), Effect))
    check_declaration(cls)
    check_form(cls)
    check_null_hooks(cls)
    check_hooks([cls])
    assert list(cls.hooks()) == [hook]
    assert cls.name == path.stem


def test_the_reference_page_is_up_to_date() -> None:
    page = Path(__file__).parents[2] / "docs" / "reference" / "effects.md"
    remedy = "run: agvbench effects --markdown > docs/reference/effects.md"
    assert page.read_text(encoding="utf-8") == reference_page(), remedy


def load(path: Path):  # type: ignore[no-untyped-def]
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _vector(simulation: Simulation, cls: type[Effect], values: dict[str, float]) -> np.ndarray:
    return simulation.parameters([cls(**values)])
