"""What holds for every static map: a new file in the package is tested here without another line."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import agvbench.vehicle.maps as maps_package
from agvbench.errors import VehicleError
from agvbench.vehicle.maps import Fixed, FullSpeedOrStop, StaticMap, map_from_toml, map_kinds

EXAMPLES = [
    pytest.param(example, id=f"{kind}-{i}")
    for kind, cls in map_kinds().items()
    for i, example in enumerate(cls.examples())
]
INVERTIBLE = [p for p in EXAMPLES if not isinstance(p.values[0], Fixed | FullSpeedOrStop)]
share = st.floats(0.0, 1.0)


def finite_range(static_map: StaticMap) -> tuple[float, float]:
    low, high = static_map.command_range
    if isinstance(static_map, Fixed):
        return -3000.0, 3000.0
    inner = low if math.isfinite(low) else high
    return (low if math.isfinite(low) else inner - 500.0), (high if math.isfinite(high) else inner + 500.0)


def test_every_file_of_the_package_adds_a_kind() -> None:
    helpers = {"__init__", "base", "registry", "solve"}
    files = {path.stem for path in Path(maps_package.__file__).parent.glob("*.py")} - helpers
    assert files == set(map_kinds())
    assert {"line", "line_with_end_stops", "cubic", "dead_band_with_saturation", "monotone_table"} <= files


@pytest.mark.parametrize("static_map", INVERTIBLE)
@given(share=share)
def test_forward_of_inverse_is_the_output(static_map: StaticMap, share: float) -> None:
    first, last = (float(static_map(command)) for command in finite_range(static_map))
    wanted = first + share * (last - first)
    assert float(static_map(static_map.inverse(wanted))) == pytest.approx(wanted, abs=1e-9 * abs(last - first))


@pytest.mark.parametrize("static_map", INVERTIBLE)
@given(share=share)
def test_inverse_of_forward_is_the_command_unless_the_map_is_flat_there(static_map: StaticMap, share: float) -> None:
    low, high = finite_range(static_map)
    command = low + share * (high - low)
    step = 1e-6 * (high - low)
    risen = float(static_map(min(command + step, high))) - float(static_map(max(command - step, low)))
    steepness = abs(risen) / 2e-6
    if steepness > 0.05 * abs(float(static_map(high)) - float(static_map(low))):
        assert float(static_map.inverse(static_map(command))) == pytest.approx(command, abs=1e-6 * (high - low))


@pytest.mark.parametrize("static_map", EXAMPLES)
@given(a=share, b=share)
def test_monotone(static_map: StaticMap, a: float, b: float) -> None:
    low, high = finite_range(static_map)
    first, second = (float(static_map(low + s * (high - low))) for s in sorted((a, b)))
    rounding = 1e-14 * max(1.0, abs(low), abs(high)) * 0.01
    assert second >= first - rounding if static_map.is_rising else second <= first + rounding


@pytest.mark.parametrize("static_map", EXAMPLES)
def test_beyond_the_range_nothing_changes(static_map: StaticMap) -> None:
    for end, beyond in zip(static_map.command_range, (-1e9, 1e9), strict=True):
        if math.isfinite(end):
            assert float(static_map(beyond)) == float(static_map(end))
    low, high = static_map.output_range
    outputs = static_map(np.linspace(*finite_range(static_map), 101))
    assert np.all(outputs >= low - 1e-12)
    assert np.all(outputs <= high + 1e-12)


@pytest.mark.parametrize("static_map", EXAMPLES)
def test_shapes_are_kept(static_map: StaticMap) -> None:
    middle = float(np.mean(finite_range(static_map)))
    for shape in ((), (0,), (3,), (2, 3)):
        commands = np.full(shape, middle)
        assert static_map(commands).shape == shape
        outputs = np.full(shape, static_map.output_range[0] if isinstance(static_map, Fixed | FullSpeedOrStop) else 0.0)
        assert static_map.inverse(outputs).shape == shape


@pytest.mark.parametrize("static_map", EXAMPLES)
def test_toml_round_trip_is_exact(static_map: StaticMap) -> None:
    text = tomli_w.dumps({"map": static_map.to_toml()})
    again = map_from_toml(tomllib.loads(text)["map"])
    assert again == static_map
    assert hash(again) == hash(static_map)


@pytest.mark.parametrize("static_map", EXAMPLES)
def test_outputs_out_of_range_are_refused(static_map: StaticMap) -> None:
    low, high = static_map.output_range
    bad = [math.nan, *(end for end in (low - 0.1, high + 0.1) if math.isfinite(end))]
    for output in bad:
        with pytest.raises(VehicleError, match="output is out of the map's range"):
            static_map.inverse([low if math.isfinite(low) else high, output])


@pytest.mark.parametrize("static_map", EXAMPLES)
def test_toml_mistakes_are_told_in_one_line_with_their_place(static_map: StaticMap) -> None:
    table = static_map.to_toml()
    for key in dataclasses.asdict(static_map):  # type: ignore[call-overload]
        for bad in (math.nan, None, True, {"a": 1}):
            with pytest.raises(VehicleError, match=rf"^maps\.front\.{key}\b.*must be") as caught:
                map_from_toml({**table, key: bad}, where="maps.front")
            assert "\n" not in str(caught.value)
    with pytest.raises(VehicleError, match=r"^maps\.front: unknown key: slop"):
        map_from_toml({**table, "slop": 1.0}, where="maps.front")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"slope": 1.0}, "map: a key is missing: kind"),
        ({"kind": "spline"}, "map.kind: unknown kind of map: 'spline' (one of: cubic, "),
        ({"kind": ["line"]}, "map.kind: unknown kind of map"),
        (3.0, "map: must be a table: 3.0"),
        ({"kind": "line", "slope": 1.0}, "map: a key is missing: intercept; add intercept = …"),
        ({"kind": "line", "slope": 1.0, "intersept": 0.0}, "map: unknown key: intersept; did you mean intercept?"),
        ({"kind": "line", "slope": 0, "intercept": 0}, "map.slope: a line without slope has no inverse"),
    ],
)
def test_registry_errors(table: object, message: str) -> None:
    with pytest.raises(VehicleError) as caught:
        map_from_toml(table)
    assert str(caught.value).startswith(message)
