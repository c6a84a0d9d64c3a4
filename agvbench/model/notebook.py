"""How a notebook shows a vehicle model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from agvbench.notebook_html import heading_html, table_html

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel

_UNITS = {"front": ("°", math.degrees(1.0)), "rear": ("°", math.degrees(1.0)), "drive": ("m/s", 1.0)}


def model_html(model: VehicleModel) -> str:
    """Return its geometry, its static maps with the range of their outputs, and its effects with their parameters."""
    geometry = model.geometry
    line = (
        f"front axle {geometry.front_axle_m:g} m ahead of the marker centroid, rear axle {geometry.rear_axle_m:g} m "
        f"behind it; commands in {model.command_unit}, neutral {model.neutral:g}"
    )
    maps = [_map_row(model, role) for role in _UNITS]
    effects = [
        (effect.name, p.name, effect.values[p.name], p.unit) for effect in model.effects for p in effect.parameters()
    ]
    return (
        heading_html(model.name, line)
        + table_html("static maps", ["channel", "kind", "lowest", "highest", "unit"], maps)
        + table_html("effects", ["effect", "parameter", "value", "unit"], effects)
    )


def _map_row(model: VehicleModel, role: str) -> tuple[str, str, float, float, str]:
    static_map = getattr(model, role)
    unit, scale = _UNITS[role]
    low, high = static_map.output_range
    return role, static_map.kind.replace("_", " "), scale * low, scale * high, unit
