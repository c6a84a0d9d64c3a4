"""An independent truth for rollouts: the equations of motion written out, integrated piece by piece by DOP853."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from agvbench.types import Floats


@dataclass(frozen=True)
class Truth:
    """A two-axle vehicle with delay and lags; T = 0 means at once."""

    lf: float
    lr: float
    delay: float
    steering_lag: float
    accelerate: float
    brake: float

    def poses(self, times: Floats, settled: Floats, start: Floats, neutral: tuple[float, float], t: Floats) -> Floats:
        """Return (n, 3) poses at `t` for settled (front, rear, speed) from each of `times` on."""
        state = np.array([*start, *neutral, 0.0])
        poses = np.tile(np.asarray(start, dtype=float), (len(t), 1))
        begins = times + self.delay
        for i, begin in enumerate(begins):
            end = min(begins[i + 1] if i + 1 < len(begins) else math.inf, t[-1])
            now = float(begin)
            while now < end:
                state, now = self._piece(state, settled[i], now, end, t, poses)
        return poses

    def _piece(
        self, state: Floats, settled: Floats, begin: float, end: float, t: Floats, poses: Floats
    ) -> tuple[Floats, float]:
        front, rear, speed = settled
        state = state.copy()
        if self.steering_lag == 0.0:
            state[3:5] = front, rear
        reversing = state[5] * speed < 0.0
        lag = self.brake if reversing or abs(speed) <= abs(state[5]) else self.accelerate
        if lag == 0.0:
            state[5] = 0.0 if reversing else speed
            if reversing:
                return state, begin

        def standstill(_: float, y: Floats) -> float:
            return float(y[5])

        standstill.terminal = True  # type: ignore[attr-defined]
        solution: Any = solve_ivp(
            self._equations(front, rear, speed, lag),
            (begin, end),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
            max_step=0.1,  # its dense output is less accurate than its steps
            events=[standstill] if reversing else None,
        )
        reached = solution.t[-1]
        inside = (t > begin) & (t <= reached)
        if inside.any():
            poses[inside] = solution.sol(t[inside])[:3].T
        state = solution.y[:, -1].copy()
        if reversing and solution.status == 1:
            state[5] = 0.0
        return state, reached

    def _equations(self, front: float, rear: float, speed: float, lag: float) -> Callable[[float, Floats], list[float]]:
        def right_hand_side(_: float, y: Floats) -> list[float]:
            heading, df, dr, v = y[2:]
            # Eq. 5.6–5.10 as printed, with the two corrections: polar form, unlike the code under test.
            beta = math.atan((self.lf * math.tan(dr) + self.lr * math.tan(df)) / (self.lf + self.lr))
            body = v * (math.cos(df) + math.cos(dr)) / (2.0 * math.cos(beta))
            yaw = body * math.cos(beta) * (math.tan(df) - math.tan(dr)) / (self.lf + self.lr)
            steer = 0.0 if self.steering_lag == 0.0 else 1.0 / self.steering_lag
            return [
                body * math.cos(heading + beta),
                body * math.sin(heading + beta),
                yaw,
                (front - df) * steer,
                (rear - dr) * steer,
                0.0 if lag == 0.0 else (speed - v) / lag,
            ]

        return right_hand_side
