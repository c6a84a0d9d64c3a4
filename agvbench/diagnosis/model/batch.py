"""Runs packed for simulation."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.diagnosis.model.perturbations import Integers, Perturbations
from agvbench.diagnosis.model.repeats import Repeats
from agvbench.diagnosis.model.smoothness import SmoothnessPrior
from agvbench.effects import Effect
from agvbench.model.priors import Prior
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry


class Batch:
    """Runs packed for simulation: one batch serves every set of effects, including ``kinds`` outside the library.

    ``smoothness`` is the prior of the nodal values. ``nodal_deviation`` is that of `Simulation.predict`.
    ``autocorrelation_time`` is the number of windows that are worth one independent window. ``has_heavy_tails`` is
    whether the errors of runs have Student's t distribution; those of windows always do.
    """

    has_heavy_tails: bool = False

    def __init__(
        self,
        readings: Readings,
        maps: NodalMaps,
        geometry: Geometry,
        nodal_deviation: float = np.inf,
        autocorrelation_time: float = 1.0,
        kinds: Sequence[type[Effect]] = (),
    ) -> None:
        self.readings, self.maps, self.geometry = readings, maps, geometry
        self.nodal_deviation, self.autocorrelation_time, self.kinds = (
            nodal_deviation,
            autocorrelation_time,
            tuple(kinds),
        )
        self.smoothness = SmoothnessPrior.of(maps, readings)
        self.repeats = Repeats.of(readings)
        self._alike: tuple[Floats, Repeats] = np.empty(0), self.repeats
        self._runs = readings.simulated()
        self.base = Simulation(geometry, maps.neutral, self._runs, kinds=kinds)
        self.commands: dict[str, Floats] = {role: getattr(self.base, role) for role in ROLES}
        self.weights = {role: maps.weights(role, self.commands[role]) for role in ROLES}
        self.acting = self._acting()

    @cached_property
    def perturbations(self) -> Perturbations:
        """The perturbed runs, which are packed when derivatives are needed for the first time."""
        return Perturbations.of(self.base, self._runs, self.maps, self.acting, self.weights)

    def alike(self, poses: Floats, heading: Floats) -> Repeats:
        """Return the repeats whose `poses` (R, K, 3), predicted from a `heading` (R,), are alike; the last are kept."""
        if self._alike[0] is not poses:
            self._alike = poses, self.repeats.among_alike(poses, heading)
        return self._alike[1]

    def perturbations_of(self, repeats: Repeats) -> Integers:
        """Return the perturbation (n,) of each run's representative; those of repeats are in the same order."""
        run = self.perturbations.run
        begins = np.searchsorted(run, np.arange(len(self.readings)))
        behind = np.arange(len(run)) - begins[run]
        return np.asarray(begins[repeats.representative[run]] + behind)

    def _acting(self) -> dict[str, NDArray[np.bool_]]:
        """Return the rows (rows,) in which each channel acts: the drive unless it is at neutral, the steering always.

        The yaw rate of a differential vehicle acts while the vehicle is commanded to move.
        """
        driven = self.commands["drive"] != self.maps.neutral.drive
        always = np.ones(len(driven), dtype=np.bool_)
        turns = driven | (self.commands["front"] != self.maps.neutral.front)
        return {"drive": driven, "front": turns if self.geometry.is_differential else always, "rear": always}

    def repacked(
        self,
        readings: Readings | None = None,
        *,
        kinds: Sequence[type[Effect]] | None = None,
        preset: bool | None = None,
    ) -> Batch:
        """Return this batch with other runs, effects outside the library, or hypothesis on the initial steering.

        `preset` is that of `Readings`. What is not given stays as it is.
        """
        readings = self.readings if readings is None else readings
        readings = readings if preset is None else replace(readings, preset=preset)
        kinds, level = self.kinds if kinds is None else kinds, self.nodal_deviation
        return Batch(readings, self.maps, self.geometry, level, self.autocorrelation_time, kinds)

    def with_priors(self, priors: tuple[Prior, ...]) -> Batch:
        """Return this batch with other priors of the effects' parameters; both share the packed runs."""
        other = copy(self)
        other.readings = replace(self.readings, priors=priors)
        return other

    def with_heavy_tails(self) -> Batch:
        """Return this batch with heavy tails; both share the packed runs."""
        other = copy(self)
        other.has_heavy_tails = True
        return other
