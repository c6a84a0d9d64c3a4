"""A fitted model of which steering, drive, clock, rigid body and maps have other values in each window.

Two kinds of values differ: what varies between recordings, such as the level of the drive, and nodal values of the maps
that the training windows hardly determine.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agvbench.diagnosis.criteria import VARYING
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import Floats

_LEAST_SIZE = 1e-3
_RAD, _PER_M, _S = "rad", "per_m", "s"
_CLOCK, _BODY = "clock", "body"
_STEP, _STEP_S = 1e-3, 0.02


def in_turned_axes(changes: Floats, angle: Floats) -> Floats:
    """Return differences of poses (…, 3) in axes that are turned by `angle` (…)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, turn = np.moveaxis(changes, -1, 0)
    return np.stack([c * x + s * y, c * y - s * x, turn], axis=-1)


@dataclass(frozen=True)
class Quantity:
    """What may vary: the offset or the gain of a channel's static map, or the offset of the clock or the rigid body.

    Gains are natural logarithms of factors. The offset of a steered axle is an angle. That of a differential vehicle's
    yaw rate is proportional to the speed, as with wheels of unequal diameters: a curvature. The offset of the clock is
    by how much later than its stamps a command is given, as in `Simulation.predict`. That of the rigid body is by how
    much the measured heading is larger than the vehicle's, since its axes were defined anew.
    """

    role: str
    unit: str = ""

    @property
    def is_gain(self) -> bool:
        """Whether this is a gain, which has no unit."""
        return not self.unit

    @property
    def varies_within(self) -> bool:
        """Whether it may also vary for seconds: wheels, clocks and rigid bodies do not."""
        return self.role not in (_CLOCK, _BODY) and self.unit != _PER_M

    @property
    def step(self) -> float:
        """The step of a difference that stands for a derivative.

        That of the clock is long: a command that takes effect just as a window begins changes its initial state, and
        one such window must not seem to determine the clock.
        """
        return _STEP_S if self.role == _CLOCK else _STEP

    @property
    def name(self) -> str:
        """The name with its unit, such as ``front_offset_rad``."""
        return f"{self.role}_offset_{self.unit}" if self.unit else f"{self.role}_gain"


@dataclass(frozen=True)
class VaryingModel:
    """A fitted model; ``covariance`` (N, N) is that of the nodal values of its maps."""

    predictor: Predictor
    parameters: Floats
    covariance: Floats

    @classmethod
    def of(cls, fitted: Fit, batch: Batch) -> VaryingModel:
        """Return a fitted model in the windows of a batch."""
        maps = slice(batch.maps.size)
        predictor = Predictor(batch, fitted.predictor.effects)
        return cls(predictor, fitted.parameters, fitted.covariance[maps, maps])

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """What may vary: offset and gain of each channel that steers, the gain of the drive, clock and rigid body.

        A channel with one command in all windows does not steer. Quantities that vary within a recording come first.
        """
        nodes = self.predictor.maps.nodes
        unit = _PER_M if self.predictor.batch.geometry.is_differential else _RAD
        steered = [role for role in ROLES if role != "drive" and len(nodes[role]) > 1]
        of_maps = [*(Quantity(role, of) for role in steered for of in (unit, "")), Quantity("drive")]
        others = [Quantity(_CLOCK, _S), Quantity(_BODY, _RAD)]
        return tuple(sorted([*of_maps, *others], key=lambda quantity: not quantity.varies_within))

    @cached_property
    def steps(self) -> Floats:
        """The steps (m + r,) of differences by the quantities and by the map components."""
        return np.array([*(quantity.step for quantity in self.quantities), *[_STEP] * len(self.map_components)])

    @cached_property
    def map_components(self) -> Floats:
        """Changes of the nodal values (r, N) of one standard deviation: principal components of their uncertainty.

        Components that change no map by `VaryingCriteria.least_map_change` of its largest value are left out. There are
        at most `max_map_components`, those of the largest variances.
        """
        maps = self.predictor.maps
        drive, sizes = maps.slices()["drive"], np.empty(maps.size)
        for own in (slice(0, drive.start), drive):
            sizes[own] = max(float(np.max(np.abs(self.parameters[own]), initial=0.0)), _LEAST_SIZE)
        variance, axes = np.linalg.eigh(self.covariance / np.outer(sizes, sizes))
        components = (axes * np.sqrt(np.maximum(variance, 0.0))).T[::-1]
        kept = np.max(np.abs(components), axis=1) > VARYING.least_map_change
        return np.asarray(components[kept][: VARYING.max_map_components] * sizes)

    @property
    def as_fitted(self) -> Floats:
        """The predicted poses (W, K, 3) with none of the values changed."""
        return self.predictor.predict(self.parameters)

    def poses(self, values: Floats) -> Floats:
        """Return the predicted poses (W, K, 3) for `values` (W, m + r) of the quantities and of the map components."""
        batch, quantities = self.predictor.batch, self.quantities
        settled, initial = self.predictor.settled(self.parameters)
        self._add_components(settled, values[:, len(quantities) :])
        later_s, turned = np.zeros(len(values)), np.zeros(len(values))
        for k, quantity in enumerate(quantities):
            if quantity.role == _CLOCK:
                later_s += values[:, k]
            elif quantity.role == _BODY:
                turned += values[:, k]
            else:
                self._change(settled, quantity, values[batch.base.row_runs, k])
        parameters, deviation = self.predictor.all_parameters(self.parameters), batch.nodal_deviation
        poses = batch.base.predict(settled, parameters, initial, nodal_deviation=deviation, later_s=later_s)
        return self._turned(poses.reshape(len(values), -1, 3), turned)

    def _turned(self, poses: Floats, angle: Floats) -> Floats:
        """Return `poses` (W, K, 3) of vehicles whose measured heading is larger than their own by `angle` (W,).

        The path turns about its beginning. The measured change of heading is that of the vehicle.
        """
        away = poses - self.predictor.readings.start[:, None]
        # Without a turn the poses stay exactly as they are.
        return np.asarray(poses + (in_turned_axes(away, angle[:, None]) - away))

    def _change(self, settled: Floats, quantity: Quantity, of_row: Floats) -> None:
        """Change angles and speeds of every row (rows, 3) by the value `of_row` (rows,) of a quantity of a map."""
        column = ROLES.index(quantity.role)
        if quantity.is_gain:
            settled[:, column] *= np.exp(of_row)
        elif quantity.unit == _PER_M:
            settled[:, column] += of_row * settled[:, ROLES.index("drive")]
        else:
            settled[:, column] += of_row
        if quantity.role != "drive":
            settled[:, column] = np.clip(settled[:, column], *self.predictor.steering_limits)

    def _add_components(self, settled: Floats, values: Floats) -> None:
        """Add what the map components with `values` (W, r) change in every row (rows, 3)."""
        batch = self.predictor.batch
        nodal = (values @ self.map_components)[batch.base.row_runs]
        for role, own in self.predictor.maps.slices().items():
            settled[:, ROLES.index(role)] += np.sum(batch.weights[role] * nodal[:, own], axis=1)
