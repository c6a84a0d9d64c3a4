"""The vehicle with refitted maps and the effects found."""

from __future__ import annotations

import numpy as np

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.nodal_maps import NodalMaps
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.model import VehicleModel
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, MonotoneTable, StaticMap

_DIGITS = 9


def corrected_vehicle(header: HeaderLike, geometry: Geometry, fitted: Fit, maps: NodalMaps, seed: int) -> VehicleModel:
    """Return the vehicle of `fitted` with its priors; its maps are tables, made monotone by isotonic regression."""
    where = maps.slices()
    weight = np.maximum(np.diagonal(fitted.information.total), 1e-6)
    limits = fitted.predictor.steering_limits
    values = {
        role: fitted.parameters[own] if role == "drive" else np.clip(fitted.parameters[own], *limits)
        for role, own in where.items()
    }
    tables: dict[str, StaticMap] = {}
    for role, own in where.items():
        nodes, value, of_role = maps.nodes[role], values[role], weight[own]
        if role in maps.zero_at_neutral:
            place = int(np.searchsorted(nodes, getattr(maps.neutral, role)))
            nodes, value = np.insert(nodes, place, getattr(maps.neutral, role)), np.insert(value, place, 0.0)
            of_role = np.insert(of_role, place, 1e12)
        tables[role] = _table(nodes, value, of_role) if len(nodes) else Fixed(command=getattr(maps.neutral, role))
    return VehicleModel(
        name=header.vehicle_name,
        geometry=geometry,
        channels=header.channels,
        **tables,
        effects=_effects(fitted),
        provenance={"campaign": header.name, "method": "diagnose", "seed": seed},
        priors=fitted.predictor.readings.priors,
    )


def _effects(fitted: Fit) -> tuple[Effect, ...]:
    kinds, values = {**effect_kinds(), **effect_variants()}, fitted.effect_values()
    return tuple(
        kinds[name](**{key.partition(".")[2]: v for key, v in values.items() if key.partition(".")[0] == name})
        for name in fitted.predictor.effects
        if name in kinds  # a discrepancy term is no part of a vehicle
    )


def _table(commands: Floats, values: Floats, weight: Floats) -> StaticMap:
    if len(commands) < 2 or np.ptp(values) == 0.0:
        return Fixed(output=round(float(values[0]), _DIGITS), command=float(commands[0]))
    from scipy.optimize import isotonic_regression

    both = [isotonic_regression(values, weights=weight, increasing=rising).x for rising in (True, False)]
    smooth = min(both, key=lambda one: float(weight @ (one - values) ** 2)).round(_DIGITS)
    if np.ptp(smooth) == 0.0:  # an axle that does not respond
        return Fixed(output=float(smooth[0]), command=float(commands[0]))
    return MonotoneTable(tuple(commands.tolist()), tuple(smooth.tolist()), "linear")
