"""What a vehicle model predicts for a batch of runs, whatever its effects: the rollout's slower, general sibling."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.model.batch import RolloutBatch
from agvbench.model.rollout import settled_targets
from agvbench.model.simulation.simulated_run import SimulatedRun
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Commands, Floats

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel


def general_rollout(
    model: VehicleModel,
    commands: Sequence[Commands],
    initial: ArrayLike,
    t_s: Sequence[ArrayLike],
    started_h: Sequence[float] | None = None,
) -> list[Floats]:
    """Simulate runs with any effects; as `agvbench.model.rollout.rollout`, with errors near 1e-6 m and rad.

    Parameters
    ----------
    model, commands, initial, t_s
        As there; `initial` is what the camera reports.
    started_h
        When each run began, in hours since the session began; all at its beginning by default.

    Returns
    -------
    list of ndarray
        Per run, shape (n, 3): x [m], y [m], heading [rad] as the camera reports them.

    Raises
    ------
    InputError
        If the runs are not finite, not in order, or not equally many, naming the run.
    VehicleError
        If the model turns an axle beyond 89°.
    """
    batch = RolloutBatch.pack(commands, initial, t_s)
    if not len(batch.initial):
        return []
    settled_targets(model, batch)
    hours = np.zeros(len(commands)) if started_h is None else started_h
    times = [np.asarray(t, dtype=np.float64) for t in t_s]
    runs = [SimulatedRun(c, t, float(h)) for c, t, h in zip(commands, times, hours, strict=True)]
    kinds = _beyond_the_library([type(effect) for effect in model.effects])
    simulation = Simulation(model.geometry, model.neutral, runs, kinds=kinds)
    states = np.column_stack([batch.initial, np.zeros(len(runs))])
    settled = simulation.settled(model.front, model.rear, model.drive)
    return simulation.split(simulation.predict(settled, simulation.parameters(model.effects), states))


def _beyond_the_library(kinds: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Return what a simulation needs for `kinds`: other laws all together, since each set takes long to compile."""
    variants = list(effect_variants().values())
    others = [kind for kind in kinds if kind not in effect_kinds().values() and kind not in variants]
    return [*(variants if any(kind in variants for kind in kinds) else []), *others]
