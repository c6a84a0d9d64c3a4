"""End stops and dead bands in the refitted maps that the nominal maps lack.

Nodal maps absorb an end stop or a dead band, so that no effect has to be fitted for them. The nominal vehicle file
lacks them, however, and a planner that uses it requests angles and speeds that cannot be reached. Shapes with and
without them are therefore fitted to the refitted values under their covariance. A map that differs from the nominal one
in slope, offset or smooth shape only has neither.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.estimation.cross_validation import clustered_covariance
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.findings.map_shapes import EndStops, RefittedMap, dead_band, end_stops
from agvbench.diagnosis.result import Estimate, NamedEffect
from agvbench.model import VehicleModel
from agvbench.types import Floats
from agvbench.vehicle.maps import DeadBandWithSaturation, Fixed, FullSpeedOrStop, LineWithEndStops, StaticMap

_SOURCE = "read off the refitted map against the nominal one"
_FLAT_SLOPE = 0.05
_GRID = 400
_REST_SHARE, _MIN_BAND = 0.01, 0.02


@dataclass(frozen=True)
class _MapPair:
    """The nominal and the refitted map of one role."""

    prior_model: StaticMap
    refitted: RefittedMap


def map_effects(fitted: Fit, vehicle: VehicleModel | None) -> tuple[NamedEffect, ...]:
    """Return ``steering_saturation`` and ``drive_dead_band`` where the maps have them and `vehicle` does not.

    Without a vehicle there is no nominal map to compare with.
    """
    if vehicle is None:
        return ()
    known = _known(fitted, vehicle)
    given = {effect.name for effect in vehicle.effects}
    found = []
    if "steering_saturation" not in given:
        found += list(_saturation({role: known[role] for role in ("front", "rear")}))
    if "drive_dead_band" not in given:
        found += list(_dead_band(known["drive"], fitted.predictor.maps.neutral.drive))
    return tuple(found)


def _known(fitted: Fit, vehicle: VehicleModel) -> dict[str, _MapPair]:
    maps = fitted.predictor.maps
    covariance = clustered_covariance(fitted, fitted.predictor.readings.group)
    out = {}
    for role, own in maps.slices().items():
        prior_model: StaticMap = getattr(vehicle, role)
        refitted = RefittedMap(maps.nodes[role], fitted.parameters[own], covariance[own, own])
        out[role] = _MapPair(prior_model, refitted)
    return out


def _saturation(axles: dict[str, _MapPair]) -> Iterator[NamedEffect]:
    estimates, gain = {}, 0.0
    for role, known in axles.items():
        if isinstance(known.prior_model, Fixed) or known.refitted.agrees_with(known.prior_model):
            continue
        stops = end_stops(known.refitted, known.prior_model)
        if stops is None:
            continue
        low, high = _prior_has_stops(known.prior_model, known.refitted.commands, rising=stops.rising)
        if limits := [*_side(stops, "low", low), *_side(stops, "high", high)]:
            value, stderr = np.mean(limits, axis=0)
            spread = 0.5 * float(np.ptp([limit for limit, _ in limits]))
            estimates[f"{role}_rad"] = Estimate(float(value), math.hypot(float(stderr), spread), "rad")
            gain += stops.gain
    if estimates:
        yield NamedEffect("steering_saturation", estimates, (), {"loss_without_it": gain, "source": _SOURCE})


def _side(stops: EndStops, side: str, is_nominal: bool) -> Iterator[tuple[float, float]]:
    value, stderr = getattr(stops, side)
    if not is_nominal and math.isfinite(value):
        yield abs(value), stderr


def _prior_has_stops(prior_model: StaticMap, commands: Floats, *, rising: bool) -> tuple[bool, bool]:
    """Return whether a map has a stop at low and at high outputs, by its kind or because its ends are flat."""
    if isinstance(prior_model, LineWithEndStops):
        return math.isfinite(prior_model.output_low), math.isfinite(prior_model.output_high)
    if isinstance(prior_model, DeadBandWithSaturation):
        return True, True
    at = np.linspace(commands[0], commands[-1], _GRID)
    slope = np.abs(np.diff(prior_model(at)))
    usual = float(np.median(slope))
    ends = bool(slope[0] <= _FLAT_SLOPE * usual), bool(slope[-1] <= _FLAT_SLOPE * usual)
    return ends if rising else (ends[1], ends[0])


def _dead_band(drive: _MapPair, neutral: float) -> Iterator[NamedEffect]:
    if drive.refitted.agrees_with(drive.prior_model) or _prior_has_dead_band(
        drive.prior_model, drive.refitted.commands, neutral
    ):
        return
    band = dead_band(drive.refitted, drive.prior_model, neutral)
    if band is not None:
        width = Estimate(band.width, band.stderr, "command")
        yield NamedEffect("drive_dead_band", {"width": width}, (), {"loss_without_it": band.gain, "source": _SOURCE})


def _prior_has_dead_band(prior_model: StaticMap, commands: Floats, neutral: float) -> bool:
    """Return whether a map has a dead band, or does not define small commands."""
    if isinstance(prior_model, FullSpeedOrStop | Fixed):
        return True
    if isinstance(prior_model, DeadBandWithSaturation):
        return prior_model.low_edge < prior_model.high_edge
    farthest = float(np.max(np.abs(commands - neutral)))
    at = neutral + farthest * np.linspace(-1.0, 1.0, 2 * _GRID + 1)
    speed = np.abs(prior_model(at))
    at_rest = np.abs(at[speed <= _REST_SHARE * float(speed.max())] - neutral)
    # A line is below the limit of rest in a known share of its range, a dead band in a larger one.
    return bool(len(at_rest) and float(at_rest.max()) > (_REST_SHARE + _MIN_BAND) * farthest)
