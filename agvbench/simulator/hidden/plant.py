"""`HiddenPlant`: a quiet vehicle with static maps that may hide an effect, behind the plant protocol."""

from __future__ import annotations

import numpy as np

from agvbench.errors import PlantError
from agvbench.simulator.checked_plant import checked_advance, checked_pose
from agvbench.simulator.hidden import _kernel as kernel
from agvbench.simulator.hidden.constants import LATENCY_S, NAMES, pack
from agvbench.simulator.hidden.truth import SealedTruth
from agvbench.simulator.random_streams import random_stream

_HOUR_S = 3600.0
TURNAROUND_S = 15.0
"""Between a run and the next reset: what fetching the vehicle takes. Batteries drain and servos warm meanwhile."""


class HiddenPlant:
    """A vehicle whose sealed truth says what it hides.

    Commands beyond the range are clipped; what is no finite number is an error. Equal calls give equal poses bit for
    bit. A reset places the vehicle so that the camera *sees* it at the pose: a displaced marker, a scale or a lens
    shows in how it moves, not in where it starts.

    Parameters
    ----------
    constants
        Base and mechanisms by name (`constants.BASE`, `constants.NULL`); what is not given is at base or null.
    play
        Standard deviations of what each reset draws: front and rear angle [rad], relative speed.
    seed
        Seeds the play, together with the seed of each reset.
    truth
        What `sealed_truth` returns; it says when constants change.
    turnaround_s
        Time that passes at a reset after a drive [s].
    """

    def __init__(
        self,
        constants: dict[str, float],
        run_variation: tuple[float, float, float],
        seed: int,
        truth: SealedTruth,
        *,
        turnaround_s: float = TURNAROUND_S,
    ) -> None:
        self._full, self._constants = pack(constants), pack(constants)
        if self._constants[LATENCY_S] > 0.9 * kernel.PAST * kernel.STEP_S:
            raise PlantError(
                "camera latency is too long", value=f"{self._constants[LATENCY_S]:g} s",
                limit=f"{0.9 * kernel.PAST * kernel.STEP_S:.1f} s",
            )  # fmt: skip
        self._spread, self._seed, self._truth, self._turnaround_s = run_variation, seed, truth, turnaround_s
        self._state = np.zeros(kernel.STATE_SIZE)
        self._ring, self._past = np.zeros((kernel.RING, 3)), np.zeros((kernel.PAST, 4))
        self._marks = np.zeros(3, dtype=np.int64)
        self._work = np.zeros((2, kernel.STATE_SIZE))
        self._run_variation = np.zeros(3)
        self._driven = False
        self.reset((0.0, 0.0, 0.0), seed=0)

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put the vehicle at rest where the camera sees it at `pose`; the session's time goes on.

        Raises
        ------
        PlantError
            If the pose is not finite.
        """
        x, y, heading = checked_pose(pose)
        rng = random_stream(self._seed, seed)
        self._run_variation[:] = rng.standard_normal(3) * self._spread
        if self._driven:
            self._state[kernel.SESSION] += self._work[1, 0] + self._turnaround_s
        self._driven = False
        self._work[1, 0] = 0.0
        self._change_constants()
        kernel.begin(self._constants, self._state, self._past, self._marks, (x, y, heading))

    def _change_constants(self) -> None:
        """Set the constants that change to their values at this time: they are held during a run."""
        for change in self._truth.changes:
            share = change.share(float(self._state[kernel.SESSION]) / _HOUR_S)
            for name in change.constants:
                self._constants[NAMES.index(name)] = share * self._full[NAMES.index(name)]

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Hold the command for `dt` seconds; return the pose that the camera sees, without its noise (m, m, rad).

        Raises
        ------
        PlantError
            If a command is not a finite number, or `dt` is negative, not finite or over a day.
        """
        drive, front, rear, dt = checked_advance(drive, front, rear, dt)
        self._driven = self._driven or dt > 0.0
        pose: tuple[float, float, float] = kernel.advance(
            self._constants, self._run_variation, self._state, self._ring, self._past, self._marks, self._work,
            drive, front, rear, dt,
        )  # fmt: skip
        return pose

    def sealed_truth(self) -> SealedTruth:
        """Return what is hidden. For scoring, after the diagnosis has answered."""
        return self._truth
