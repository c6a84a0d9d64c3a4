"""Parameters of the plants that ship: constants that a factory takes by keyword, with their ranges."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from agvbench.errors import OneOf, PlantError
from agvbench.simulator.vehicle_parameters import MAX_DELAY_FRAMES

Record = TypeVar("Record")
Factory = TypeVar("Factory", bound=Callable[..., Any])


@dataclass(frozen=True)
class PlantParameter:
    """A constant of a simulated vehicle that a factory takes by keyword.

    ``fields`` are its places in the vehicle's dataclass, a nested one with a dot; `low` and `high` in `unit`.
    """

    fields: tuple[str, ...]
    low: float
    high: float
    unit: str


def _one(field: str, low: float, high: float, unit: str) -> PlantParameter:
    return PlantParameter((field,), low, high, unit)


TWO_AXLES: Mapping[str, PlantParameter] = {
    "delay_frames": _one("delay_frames", 0.0, MAX_DELAY_FRAMES, "frames of 20 ms"),
    "front_offset_rad": _one("front.offset_rad", -0.35, 0.35, "rad"),
    "rear_offset_rad": _one("rear.offset_rad", -0.35, 0.35, "rad"),
    "servo_frequency_rad_per_s": PlantParameter(
        ("front.natural_frequency_rad_per_s", "rear.natural_frequency_rad_per_s"), 1.0, 100.0, "rad/s"
    ),
    "servo_rate_rad_per_s": PlantParameter(
        ("front.rate_limit_rad_per_s", "rear.rate_limit_rad_per_s"), 0.1, 100.0, "rad/s"
    ),
    "backlash_m": _one("drive.backlash_m", 0.0, 0.1, "m"),
    "rear_speed_ratio": _one("drive.rear_speed_ratio", 0.8, 1.2, ""),
    "marker_left_m": _one("body.marker_left_m", -0.1, 0.1, "m"),
    "understeer_s2_per_m2": _one("body.understeer_s2_per_m2", 0.0, 1.0, "s²/m²"),
    "battery_droop": _one("battery.droop", 0.0, 0.9, ""),
    "steering_scatter_rad": PlantParameter(("run_variation.front_rad", "run_variation.rear_rad"), 0.0, 0.1, "rad"),
    "speed_scatter": _one("run_variation.speed", 0.0, 0.1, ""),
}
"""Of vehicles with two axles; the scatter is the standard deviation from run to run."""

DIFFERENTIAL: Mapping[str, PlantParameter] = {
    "delay_frames": _one("delay_frames", 0.0, 14.0, "frames of 20 ms"),
    "true_track_m": _one("true_track_m", 0.05, 2.0, "m"),
    "left_radius": _one("left_radius", 0.5, 1.5, ""),
    "right_radius": _one("right_radius", 0.5, 1.5, ""),
    "natural_frequency_rad_per_s": _one("natural_frequency_rad_per_s", 1.0, 100.0, "rad/s"),
    "acceleration_mps2": _one("acceleration_mps2", 0.1, 50.0, "m/s²"),
    "fastest_mps": _one("fastest_mps", 0.05, 10.0, "m/s"),
    "slip_s2_per_m2": _one("slip_s2_per_m2", 0.0, 5.0, "s²/m²"),
    "marker_forward_m": _one("marker_forward_m", -1.0, 1.0, "m"),
    "marker_left_m": _one("marker_left_m", -1.0, 1.0, "m"),
    "droop_per_hour": _one("droop_per_hour", 0.0, 1.0, "1/h"),
    "wheel_scatter": _one("wheel_scatter", 0.0, 0.1, ""),
}
"""Of differential vehicles."""


def takes(table: Mapping[str, PlantParameter]) -> Callable[[Factory], Factory]:
    """Return a decorator that gives a factory ``(seed, **parameters)`` the signature with each parameter of `table`."""

    def decorate(factory: Factory) -> Factory:
        seed = next(iter(inspect.signature(factory).parameters.values()))
        own = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation="float | None")
            for name in table
        ]
        factory.__signature__ = inspect.Signature([seed, *own])  # type: ignore[attr-defined]
        return factory

    return decorate


def varied(vehicle: Record, table: Mapping[str, PlantParameter], parameters: Mapping[str, float | None]) -> Record:
    """Return `vehicle` with the values of `parameters`; None leaves the vehicle's own.

    Raises
    ------
    PlantError
        If there is no such parameter, or a value is out of its range.
    """
    for name, value in parameters.items():
        if name not in table:
            raise PlantError("plant has no such parameter", value=name, limit=OneOf(table))
        if value is None:
            continue
        known = table[name]
        if not known.low <= value <= known.high:
            limit = f"{known.low:g} to {known.high:g} {known.unit}".strip()
            raise PlantError("parameter is out of range", where=name, value=f"{value:g}", limit=limit)
        for field in known.fields:
            vehicle = _replaced(vehicle, field, float(value))
    return vehicle


def _replaced(record: Any, field: str, value: float) -> Any:
    outer, _, inner = field.partition(".")
    return replace(record, **{outer: _replaced(getattr(record, outer), inner, value) if inner else value})
