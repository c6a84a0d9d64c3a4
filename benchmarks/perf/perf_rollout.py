"""Batched rollout against plain numba RK4 of the same equations: 1000 runs × 10 s × 240 Hz, delay and lags active.

All get the same commands and times, start from the same objects and use one thread; ours is the public call with all
its checks. The peer's steps are aligned to the command changes (after the delay) and to the times to report: the
coarsest steps that report there, and the table shows that they meet 1e-6 m. A second peer ignores the changes
and divides each camera interval instead; it gets as many parts as it needs, up to 64. A third, beyond what was asked,
takes the coarsest aligned steps that meet 1e-6 m and interpolates (cubic Hermite) in between.

Seconds are the processor's. Accuracy is measured on 25 such runs against aligned RK4 with eight steps per frame. Run
with ``python benchmarks/perf/perf_rollout.py``.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit
from rich.console import Console
from rich.table import Table

from agvbench.effects import ActuationDelay, SpeedLag, SteeringLag
from agvbench.model import VehicleModel, thesis_vehicle
from agvbench.types import Commands, Floats

RUNS, FEW, SECONDS, RATE_HZ, ROUNDS = 1000, 25, 10.0, 240, 9
NEEDED_M = 1e-6
ASKED, STRETCH = 3.0, 8.0
# What ours is compiled with, too: everything but the assumption that infinities and NaN never occur.
FAST = {"contract", "nsz", "arcp", "reassoc", "afn"}


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _slope(heading, front, rear, speed, target, p):  # type: ignore[no-untyped-def]
    """Return the derivatives of x, y, heading, front, rear, speed."""
    tan_front, tan_rear = math.tan(front), math.tan(rear)
    forward = 0.5 * speed * (math.cos(front) + math.cos(rear))
    per_wheelbase = 1.0 / (p[0] + p[1])
    left = forward * (p[0] * tan_rear + p[1] * tan_front) * per_wheelbase
    c, s = math.cos(heading), math.sin(heading)
    grows = speed * (target[2] - speed) > 0.0 or speed == 0.0
    return (
        forward * c - left * s,
        forward * s + left * c,
        forward * (tan_front - tan_rear) * per_wheelbase,
        (target[0] - front) / p[3],
        (target[1] - rear) / p[3],
        (target[2] - speed) / (p[4] if grows else p[5]),
    )


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _step(state, target, p, h):  # type: ignore[no-untyped-def]
    """Take one classical Runge–Kutta step, in scalars: with arrays for the stages it is slower."""
    x, y, a, f, r, v = state[0], state[1], state[2], state[3], state[4], state[5]
    half, sixth = 0.5 * h, h / 6.0
    x1, y1, a1, f1, r1, v1 = _slope(a, f, r, v, target, p)
    x2, y2, a2, f2, r2, v2 = _slope(a + half * a1, f + half * f1, r + half * r1, v + half * v1, target, p)
    x3, y3, a3, f3, r3, v3 = _slope(a + half * a2, f + half * f2, r + half * r2, v + half * v2, target, p)
    x4, y4, a4, f4, r4, v4 = _slope(a + h * a3, f + h * f3, r + h * r3, v + h * v3, target, p)
    state[0] = x + sixth * (x1 + 2.0 * x2 + 2.0 * x3 + x4)
    state[1] = y + sixth * (y1 + 2.0 * y2 + 2.0 * y3 + y4)
    state[2] = a + sixth * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    state[3] = f + sixth * (f1 + 2.0 * f2 + 2.0 * f3 + f4)
    state[4] = r + sixth * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
    state[5] = v + sixth * (v1 + 2.0 * v2 + 2.0 * v3 + v4)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _until_rest(state, target, brake):  # type: ignore[no-untyped-def]
    """Return the time to standstill if the vehicle has to reverse, else infinity: RK4 must not step over this kink."""
    if state[5] * target[2] < 0.0 and abs(state[5]) > 1e-12:
        return brake * math.log((target[2] - state[5]) / target[2])
    return math.inf


@njit(cache=True, fastmath=FAST, error_model="numpy")
def rk4_aligned(p, initial, targets, command_t, t, out):  # type: ignore[no-untyped-def]
    """Step from one moment that matters to the next: times to report, command changes, standstill."""
    state = np.empty(6)
    for run in range(initial.shape[0]):
        state[:] = initial[run]
        now, command, target = p[2], 0, targets[run, 0]
        for i in range(t.size):
            while now < t[i]:
                while command + 1 < command_t.size and command_t[command + 1] + p[2] <= now:
                    command += 1
                    target = targets[run, command]
                end = t[i]
                if command + 1 < command_t.size:
                    end = min(end, command_t[command + 1] + p[2])
                rest = now + _until_rest(state, target, p[5])
                stands = rest <= end
                if stands:
                    end = rest
                _step(state, target, p, end - now)
                if stands:
                    state[5] = 0.0
                now = end
            out[run, i, 0], out[run, i, 1], out[run, i, 2] = state[0], state[1], state[2]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def rk4_divided(p, initial, targets, command_t, t, out, parts):  # type: ignore[no-untyped-def]
    """Divide each interval between times to report into equal steps; a step uses the command of its beginning."""
    state = np.empty(6)
    for run in range(initial.shape[0]):
        state[:] = initial[run]
        command = -1
        for i in range(t.size):
            if i > 0:
                h = (t[i] - t[i - 1]) / parts
                for part in range(parts):
                    now = t[i - 1] + part * h
                    while command + 1 < command_t.size and command_t[command + 1] + p[2] <= now + 1e-12:
                        command += 1
                    if command >= 0:
                        _step(state, targets[run, command], p, h)
            out[run, i, 0], out[run, i, 1], out[run, i, 2] = state[0], state[1], state[2]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _hermite(s, slope, end_slope, value, end_value):  # type: ignore[no-untyped-def]
    rise = end_value - value
    return value + s * (slope + s * (3.0 * rise - 2.0 * slope - end_slope + s * (slope + end_slope - 2.0 * rise)))


@njit(cache=True, fastmath=FAST, error_model="numpy")
def rk4_dense(p, initial, targets, command_t, t, out, longest):  # type: ignore[no-untyped-def]
    """Take aligned steps of at most `longest` seconds; report by cubic Hermite interpolation inside them."""
    state, before = np.empty(6), np.empty(6)
    for run in range(initial.shape[0]):
        state[:] = initial[run]
        i = 0
        while i < t.size and t[i] <= command_t[0] + p[2]:
            out[run, i, 0], out[run, i, 1], out[run, i, 2] = state[0], state[1], state[2]
            i += 1
        for command in range(command_t.size):
            now, end, target = command_t[command] + p[2], t[-1], targets[run, command]
            if command + 1 < command_t.size:
                end = min(end, command_t[command + 1] + p[2])
            while now < end:
                rest = now + _until_rest(state, target, p[5])
                until = min(end, rest)
                parts = math.ceil((until - now) / longest - 1e-9)
                h = (until - now) / parts
                for part in range(parts):
                    following = until if part == parts - 1 else now + h
                    before[:] = state
                    d0 = _slope(before[2], before[3], before[4], before[5], target, p)
                    _step(state, target, p, h)
                    d1 = _slope(state[2], state[3], state[4], state[5], target, p)
                    while i < t.size and t[i] <= following:
                        s = (t[i] - now) / h
                        out[run, i, 0] = _hermite(s, h * d0[0], h * d1[0], before[0], state[0])
                        out[run, i, 1] = _hermite(s, h * d0[1], h * d1[1], before[1], state[1])
                        out[run, i, 2] = _hermite(s, h * d0[2], h * d1[2], before[2], state[2])
                        i += 1
                    now = following
                if rest <= end:
                    state[5] = 0.0


class Case:
    """Runs with a command change every `period_s`."""

    def __init__(self, period_s: float, seed: int, runs: int) -> None:
        self.runs = runs
        rng = np.random.default_rng(seed)
        count = round(SECONDS / period_s)
        self.model: VehicleModel = thesis_vehicle().with_effects(
            ActuationDelay(0.0503), SteeringLag(0.12), SpeedLag(0.25, 0.4)
        )
        self.command_t = np.arange(count) * period_s
        self.commands = [Commands(self.command_t, *rng.uniform(950.0, 2050.0, (3, count))) for _ in range(runs)]
        self.t = np.arange(round(SECONDS * RATE_HZ) + 1) / RATE_HZ
        self.times = [self.t] * runs
        self.initial = np.column_stack([rng.uniform(-2.0, 2.0, (runs, 2)), rng.uniform(-3.0, 3.0, runs)])
        self.parameters = np.array([0.181, 0.121, 0.0503, 0.12, 0.25, 0.4])

    def ours(self) -> list[Floats]:
        """Run the public call."""
        return self.model.rollout(self.commands, self.initial, self.times)

    def peer(self, kernel: Callable[..., None], *extra: float) -> Floats:
        """Run a peer's kernel from the same objects; it evaluates the static maps at once, as ours does."""
        drive, front, rear = (
            np.stack([getattr(c, name) for c in self.commands]) for name in ("drive", "front", "rear")
        )
        targets = np.stack([self.model.front(front), self.model.rear(rear), self.model.speed(drive)], axis=-1)
        neutral = self.model.axle_angles(1500.0, 1500.0)
        initial = np.column_stack([self.initial, np.tile([float(neutral[0]), float(neutral[1]), 0.0], (self.runs, 1))])
        out = np.empty((self.runs, len(self.t), 3))
        kernel(self.parameters, initial, targets, self.command_t, self.t, out, *extra)
        return out

    def truth(self) -> Floats:
        """Aligned RK4 with steps eight times finer than the camera's: independent of our kernel, good to 1e-11 m."""
        fine = Case.__new__(Case)
        fine.__dict__.update(self.__dict__)
        fine.t = np.arange(8 * (len(self.t) - 1) + 1) / (8 * RATE_HZ)
        return fine.peer(rk4_aligned)[:, ::8]


def position_error(poses: Floats, truth: Floats) -> float:
    return float(np.abs(poses - truth)[..., :2].max())


def coarsest(case: Case, truth: Floats, kernel: Callable[..., None], candidates: list[float]) -> tuple[float, float]:
    """Return the first (coarsest) candidate that meets the accuracy, or the last, with its error."""
    error = math.inf
    for candidate in candidates:
        error = position_error(case.peer(kernel, candidate), truth)
        if error <= NEEDED_M:
            return candidate, error
    return candidates[-1], error


def seconds(call: Callable[[], object]) -> float:
    """Return the processor's seconds: all is one thread, and other programs on the machine must not count."""
    start = time.process_time()
    call()
    return time.process_time() - start


def measure(period_s: float, table: Table) -> bool:
    """Add the rows of one rate of command changes; return whether the bound is met."""
    case, few = Case(period_s, seed=1, runs=RUNS), Case(period_s, seed=1, runs=FEW)
    truth = few.truth()
    parts, divided_error = coarsest(few, truth, rk4_divided, [1, 4, 16, 64])
    longest, dense_error = coarsest(few, truth, rk4_dense, [n / RATE_HZ for n in (32, 24, 16, 12, 8, 6, 4, 3, 2, 1)])
    calls: dict[str, Callable[[], object]] = {
        "ours": case.ours,
        "aligned": lambda: case.peer(rk4_aligned),
        "dense": lambda: case.peer(rk4_dense, longest),
    }
    for call in calls.values():
        call()
    rounds = [{name: seconds(call) for name, call in calls.items()} for _ in range(ROUNDS)]
    median = {name: statistics.median(r[name] for r in rounds) for name in calls}
    median["divided"] = RUNS / FEW * statistics.median(seconds(lambda: few.peer(rk4_divided, parts)) for _ in range(3))
    ratio = {name: statistics.median(r[name] / r["ours"] for r in rounds) for name in calls}
    ratio["divided"] = median["divided"] / median["ours"]
    poses, our_error = RUNS * len(case.t) / 1e6, position_error(np.stack(few.ours()), truth)
    met = ratio["aligned"] >= ASKED

    def row(what: str, name: str, their_error: float, verdict: str) -> None:
        table.add_row(
            f"every {period_s} s",
            what,
            f"{poses / median['ours']:.1f} M/s, {our_error:.0e} m",
            f"{poses / median[name]:.1f} M/s, {their_error:.0e} m",
            f"{ratio[name]:.1f}×",
            verdict,
        )

    stretch = "met" if ratio["aligned"] >= STRETCH else "not met"
    verdict = f"{'yes' if met else 'NO'}: ≥ {ASKED:g}× (stretch {STRETCH:g}× {stretch})"
    row("RK4 aligned to changes and frames", "aligned", position_error(few.peer(rk4_aligned), truth), verdict)
    row(
        f"RK4, {parts} equal steps per frame",
        "divided",
        divided_error,
        "" if divided_error <= NEEDED_M else "too coarse",
    )
    row(f"RK4 aligned, ≤ {1e3 * longest:.0f} ms, Hermite", "dense", dense_error, "")
    return met


def main() -> int:
    """Print what | peer | ours | theirs | ratio | bound met?; return 0 if the bound is met at every rate of changes."""
    table = Table(title=f"rollout, {RUNS} runs × {SECONDS:g} s × {RATE_HZ} Hz, delay and lags, one thread")
    for heading in ("commands change", "peer", "ours", "theirs", "ratio", "bound met?"):
        table.add_column(heading, justify="left" if heading == "peer" else "right")
    met = [measure(period_s, table) for period_s in (1.0, 0.1)]
    Console().print(table)
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
