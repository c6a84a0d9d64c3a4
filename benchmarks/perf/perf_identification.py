"""Identification: accuracy against the Cramér–Rao bound, and time against SciPy's Levenberg–Marquardt.

100 runs of 10 s at 120 Hz, eight parameters of six effects, every initial pose free, noise known. The peer is
``scipy.optimize.least_squares(method="lm")`` by finite differences on the same simulation, in the same run; with the
eight parameters and three per run as its unknowns and, a harder peer, with the initial poses projected out for it.

``python benchmarks/perf/perf_identification.py [--runs N] [--draws N] [--rate HZ] [--rounds N]``
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from agvbench.calibration.identification import PoseNoise, identify
from agvbench.effects import effect_kinds
from agvbench.model import thesis_vehicle
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Commands, Floats

RUNS, SECONDS, RATE_HZ, DRAWS, ROUNDS = 100, 10.0, 120.0, 200, 3
NOISE = PoseNoise(3e-4, 1e-3)
EFFICIENCY, FASTER = 1.05, 5.0
VALUES: dict[str, dict[str, float]] = {
    "steering_lag": {"time_constant_s": 0.12},
    "speed_lag": {"accelerate_s": 0.15, "brake_s": 0.25},
    "cornering_speed_loss": {"loss": 0.04},
    "lateral_slip": {"gradient": 0.6},
    "reverse_steering_gain": {"gain": 0.05},
    "axle_coupling": {"front_from_rear": 0.04, "rear_from_front": -0.03},
}
NAMES = tuple(VALUES)


class Campaign:
    """Simulated runs with known truth: commands drawn every 1.5 s, from rest to rest."""

    def __init__(self, runs: int, rate_hz: float, seed: int = 1) -> None:
        model, rng = thesis_vehicle(), np.random.default_rng(seed)
        frames = np.arange(0.0, SECONDS, 1.0 / rate_hz)
        made = []
        for _ in range(runs):
            t = np.array([0.0, 0.5, 2.0, 3.5, 5.0, 6.5, 8.0])
            drive = np.r_[1500.0, rng.choice([900.0, 1200.0, 1350.0, 1650.0, 1800.0, 2100.0], 5), 1500.0]
            front, rear = 1500.0 + rng.uniform(-350.0, 350.0, (2, len(t)))
            made.append(SimulatedRun(Commands(t, drive, front, rear), frames))
        self.simulation = Simulation(model.geometry, model.neutral, made)
        self.settled = self.simulation.settled(model.front, model.rear, model.drive)
        self.parameters = self.simulation.parameters(
            [effect_kinds()[name](**values) for name, values in VALUES.items()]
        )
        self.own = self.simulation.indices(*NAMES)
        self.initial = np.column_stack(
            [rng.uniform(-1.0, 1.0, (runs, 2)), rng.uniform(-3.0, 3.0, runs), np.zeros(runs)]
        )
        self.true = self.simulation.predict(self.settled, self.parameters, self.initial)
        self.sd = np.array([NOISE.position_m, NOISE.position_m, NOISE.heading_rad])

    def draw(self, seed: int) -> Floats:
        """Return noisy poses of every frame."""
        rng = np.random.default_rng([7, seed])
        return self.true + self.sd * rng.standard_normal(self.true.shape)

    def fisher(self) -> Floats:
        """Return the information about the parameters at the truth (p, p), initial poses marginalised.

        By central differences of the simulation, parameters and initial poses alike.
        """
        j, a = self._by_parameters() / self.sd[:, None], self._by_initial_pose() / self.sd[:, None]
        total = np.zeros((len(self.own),) * 2)
        for begin, end in zip(self.simulation.frame_starts[:-1], self.simulation.frame_starts[1:], strict=True):
            own, pose = j[begin:end].reshape(-1, len(self.own)), a[begin:end].reshape(-1, 3)
            free = own - pose @ np.linalg.lstsq(pose, own, rcond=None)[0]
            total += free.T @ free
        return total

    def _by_parameters(self) -> Floats:
        columns = []
        for i in self.own:
            step = np.zeros_like(self.parameters)
            step[i] = 1e-3 * self.simulation.scales[i]
            above, below = (
                self.simulation.predict(self.settled, self.parameters + by, self.initial) for by in (step, -step)
            )
            columns.append((above - below) / (2.0 * step[i]))
        return np.stack(columns, axis=-1)

    def _by_initial_pose(self) -> Floats:
        columns = []
        for step in 1e-4 * np.eye(4)[:3]:
            above, below = (
                self.simulation.predict(self.settled, self.parameters, self.initial + by) for by in (step, -step)
            )
            columns.append((above - below) / 2e-4)
        return np.stack(columns, axis=-1)

    def first(self) -> Floats:
        """Return where every method begins: a tenth of the parameters' scales."""
        return 0.1 * self.simulation.scales[self.own]

    def ours(self, observed: Floats) -> Floats:
        """Return the parameters that `identify` finds."""
        start = self.simulation.nulls.copy()
        start[self.own] = self.first()
        return identify(self.simulation, self.settled, observed, NOISE, effects=NAMES, start=start).values

    def peer(self, observed: Floats) -> Floats:
        """Return the parameters that SciPy finds with three more unknowns per run."""
        runs, p = len(self.simulation), len(self.own)
        values = self.simulation.nulls.copy()
        initial = np.zeros((runs, 4))

        def miss(unknown: Floats) -> Floats:
            values[self.own] = unknown[:p] * self.simulation.scales[self.own]
            initial[:, :3] = unknown[p:].reshape(runs, 3)
            return ((observed - self.simulation.predict(self.settled, values, initial)) / self.sd).ravel()

        poses = observed[self.simulation.frame_starts[:-1]]
        begin = np.r_[self.first() / self.simulation.scales[self.own], poses.ravel()]
        return np.asarray(least_squares(miss, begin, method="lm").x[:p] * self.simulation.scales[self.own])

    def projected_peer(self, observed: Floats) -> Floats:
        """Return the parameters that SciPy finds when each run's pose is fitted for it within every prediction."""
        runs = len(self.simulation)
        values = self.simulation.nulls.copy()
        still = np.zeros((runs, 4))
        shape = (runs, -1, 3)

        def miss(unknown: Floats) -> Floats:
            values[self.own] = unknown * self.simulation.scales[self.own]
            path = self.simulation.predict(self.settled, values, still).reshape(shape)
            return (aligned_miss(path, observed.reshape(shape), self.sd) / self.sd).ravel()

        begin = self.first() / self.simulation.scales[self.own]
        return np.asarray(least_squares(miss, begin, method="lm").x * self.simulation.scales[self.own])


def aligned_miss(path: Floats, observed: Floats, sd: Floats) -> Floats:
    """Return the residuals of paths (R, K, 3), each turned and moved to where they are least."""
    middle_p, middle_o = path[..., :2].mean(axis=1, keepdims=True), observed[..., :2].mean(axis=1, keepdims=True)
    p, o = path[..., :2] - middle_p, observed[..., :2] - middle_o
    cross = np.sum(p[..., 0] * o[..., 1] - p[..., 1] * o[..., 0], axis=1) / sd[0] ** 2
    dot = np.sum(p * o, axis=(1, 2)) / sd[0] ** 2
    turn = np.mean(observed[..., 2] - path[..., 2], axis=1)
    count = path.shape[1]
    angle = turn.copy()
    for _ in range(4):  # Newton on the angle: position pulls through cross and dot, heading through its mean
        pull = cross * np.cos(angle) - dot * np.sin(angle) - count * (angle - turn) / sd[2] ** 2
        angle += pull / (cross * np.sin(angle) + dot * np.cos(angle) + count / sd[2] ** 2)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned = np.stack([cos * p[..., 0] - sin * p[..., 1], sin * p[..., 0] + cos * p[..., 1]], axis=-1)
    return np.concatenate([o - turned, (observed[..., 2] - path[..., 2] - angle[:, None])[..., None]], axis=-1)


def timed(estimate: Callable[[Floats], Floats], observed: Floats) -> tuple[float, Floats]:
    """Return how long an estimate takes [s], and the estimate."""
    begin = time.perf_counter()
    found = estimate(observed)
    return time.perf_counter() - begin, found


def efficiency(campaign: Campaign, draws: int) -> float:
    """Return sqrt(mean(e' F e / p)) over draws of the noise."""
    fisher = campaign.fisher()
    truth = campaign.parameters[campaign.own]
    errors = np.array([campaign.ours(campaign.draw(k)) - truth for k in range(draws)])
    return float(np.sqrt(np.mean(np.einsum("di,ij,dj->d", errors, fisher, errors)) / len(truth)))


def main() -> int:
    """Print what | ours | peer | ratio | bound met?; return 0 if every bound is met."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value, kind in (
        ("runs", RUNS, int),
        ("draws", DRAWS, int),
        ("rate", RATE_HZ, float),
        ("rounds", ROUNDS, int),
    ):
        parser.add_argument(f"--{name}", type=kind, default=value)
    given = parser.parse_args()
    campaign = Campaign(given.runs, given.rate)
    observed = campaign.draw(10**6)
    campaign.ours(observed)  # compiles
    size = f"{given.runs} runs × {SECONDS:g} s × {given.rate:g} Hz, {len(campaign.own)} parameters"
    table = Table(title=f"identification, {size}, {3 * given.runs} in initial poses")
    for heading in ("what", "ours", "peer", "ratio", "bound met?"):
        table.add_column(heading)
    off = efficiency(campaign, given.draws)
    table.add_row(f"error / Cramér–Rao, {given.draws} draws", f"{off:.3f}", "1", "", _met(off <= EFFICIENCY, "≤ 1.05"))
    met = off <= EFFICIENCY
    fisher = campaign.fisher()
    for what, peer, bound in (
        ("time, SciPy lm, all unknowns", campaign.peer, FASTER),
        ("time, SciPy lm, poses projected out", campaign.projected_peer, None),
    ):
        rounds = [(*timed(campaign.ours, observed), *timed(peer, observed)) for _ in range(given.rounds)]
        mine, theirs = (statistics.median(r[k] for r in rounds) for k in (0, 2))
        ratio = statistics.median(r[2] / r[0] for r in rounds)
        met &= bound is None or ratio >= bound
        verdict = "" if bound is None else _met(ratio >= bound, f"≥ {bound:g}")
        table.add_row(what, f"{mine:.2f} s", f"{theirs:.2f} s", f"{ratio:.1f} times faster", verdict)
        apart = np.abs(rounds[0][1] - rounds[0][3]) * np.sqrt(np.diagonal(fisher))
        table.add_row("  farthest apart, in standard errors", "", "", f"{apart.max():.1e}", "")
    Console().print(table)
    return 0 if met else 1


def _met(is_met: bool, bound: str) -> str:
    return f"{'yes' if is_met else 'NO'} ({bound})"


if __name__ == "__main__":
    sys.exit(main())
