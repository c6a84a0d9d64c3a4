"""Vehicles that ship with agvbench."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from agvbench.errors import OneOf, VehicleError
from agvbench.model.vehicle_model import VehicleModel

_DATA = Path(__file__).parent / "data"


def example_names() -> tuple[str, ...]:
    """Return the names of the vehicles that ship with agvbench.

    >>> example_names()
    ('differential', 'front_steered', 'thesis')
    """
    return tuple(sorted(path.stem for path in _DATA.glob("*.toml")))


def example_path(name: str) -> Path:
    """Return the file of a shipped vehicle, to copy and edit; raise `VehicleError` if there is none of that name."""
    if name not in example_names():
        raise VehicleError("no vehicle of this name ships with agvbench", value=name, limit=OneOf(example_names()))
    return _DATA / f"{name}.toml"


@cache
def example_vehicle(name: str) -> VehicleModel:
    """Return a shipped vehicle: ``"thesis"``, ``"front_steered"`` (normalised units), ``"differential"`` (SI units)."""
    return VehicleModel.load(example_path(name))


def thesis_vehicle() -> VehicleModel:
    """Return the vehicle of the thesis, built from its tables by `agvbench.model.thesis`.

    >>> model = thesis_vehicle()
    >>> round(float(model.speed(1400.0)), 3), model.command_for(0.0, 0.0, 0.0).drive
    (0.16, 1500.0)
    """
    return example_vehicle("thesis")
