"""Speed of the general simulation: 170 runs of 10 s, beside the fast rollout on what both can do."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from agvbench.effects import Effect, SpeedLag, SteeringLag, effect_kinds
from agvbench.model import thesis_vehicle
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Commands

RUNS, SECONDS, RATE_HZ, ROUNDS = 170, 10.0, 40.0, 21
BOUND_MS = 15.0


def make_runs() -> list[SimulatedRun]:
    """Return runs of three commands each: two turns, and a stop before the end."""
    rng = np.random.default_rng(3)
    frames = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    made = []
    for i in range(RUNS):
        front, rear = 1500.0 + rng.uniform(-400.0, 400.0, (2, 3))
        commands = Commands(np.array([0.0, 3.3, 9.7]), np.array([1100.0, 1200.0, 1500.0]), front, rear)
        made.append(SimulatedRun(commands, frames, 0.01 * i))
    return made


def milliseconds(work: Callable[[], object]) -> float:
    """Return how long `work` takes."""
    began = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - began)


def main() -> None:
    """Print the table."""
    model, runs = thesis_vehicle(), make_runs()
    simulation = Simulation(model.geometry, model.neutral, runs)
    settled = simulation.settled(model.front, model.rear, model.drive)
    initial = np.zeros((RUNS, 4))
    every = [kind(**{p.name: p.scale for p in kind.parameters()}) for kind in effect_kinds().values()]
    cases: dict[str, list[Effect]] = {
        "no effect": [],
        "steering and speed lag": [SteeringLag(0.1), SpeedLag(0.2, 0.3)],
        "every effect": every,
    }
    print("what | ours ms | peer (fast rollout) ms | ratio | bound met?")
    for name, effects in cases.items():
        parameters = simulation.parameters(effects)
        can = name != "every effect"
        peer = replace(model, effects=tuple(effects) if can else ())
        ours, theirs = [], []
        for _ in range(ROUNDS):
            ours.append(milliseconds(lambda p=parameters: simulation.predict(settled, p, initial)))
            if can:
                theirs.append(
                    milliseconds(
                        lambda m=peer: m.rollout([r.commands for r in runs], initial[:, :3], [r.t_s for r in runs])
                    )
                )
        middle = statistics.median(ours)
        beside = f"{statistics.median(theirs):.1f} | {statistics.median(theirs) / middle:.2f}" if can else "– | –"
        print(f"{name} | {middle:.1f} | {beside} | {'yes' if middle <= BOUND_MS else 'no'} (≤ {BOUND_MS:g} ms)")


if __name__ == "__main__":
    main()
