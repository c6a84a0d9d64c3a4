"""Commands as shares of full command, held for a while one after another (thesis fig. 7.1 and 7.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import FlagError
from agvbench.model import VehicleModel
from agvbench.types import Command, Commands, CommandUnit

PRESTEER_S = 0.5
_FULL_COMMAND: dict[CommandUnit, float] = {"us": 600.0, "normalised": 1.0, "si": 1.0}


@dataclass(frozen=True)
class Shares:
    """Shares of full command: drive 1 is full speed forward, steering 1 is full command to the left.

    ``drive``, ``front`` and ``rear`` are what a share of 1 adds to ``neutral``, in command units; 0 for an axle
    that is not steered.
    """

    neutral: float
    drive: float
    front: float
    rear: float

    @classmethod
    def of_model(cls, model: VehicleModel) -> Shares:
        """Return the shares of a vehicle; which way its outputs go with the command is read from its maps."""
        full = _FULL_COMMAND[model.command_unit]
        outputs = [
            static_map(np.array([model.neutral - full, model.neutral + full]))
            for static_map in (model.drive, model.front, model.rear)
        ]
        return cls(model.neutral, *(float(np.sign(high - low)) * full for low, high in outputs))

    def command(self, drive: float = 0.0, front: float = 0.0, rear: float = 0.0) -> Command:
        """Return the command of three shares.

        >>> Shares(neutral=1500.0, drive=-600.0, front=-600.0, rear=-600.0).command(drive=1, front=0.5)
        Command(drive=900.0, front=1200.0, rear=1500.0)

        Raises
        ------
        FlagError
            If a share is not between −1 and 1.
        """
        for name, share in {"drive": drive, "front": front, "rear": rear}.items():
            if not -1.0 <= share <= 1.0:
                raise FlagError(f"share of full {name} command is out of range", value=share, limit="−1 to 1")
        return Command(
            self.neutral + drive * self.drive, self.neutral + front * self.front, self.neutral + rear * self.rear
        )


def held(neutral: float, steps: Sequence[tuple[float, Command]], *, presteer_s: float = PRESTEER_S) -> Commands:
    """Return commands that hold each of `steps` (duration [s], command) in turn, then stop.

    The steering is set `presteer_s` before the vehicle drives, so that the arc is steered from its beginning;
    after the stop it stays as it is, since a vehicle at rest should not turn its wheels while its pose is read.
    """
    first, last = steps[0][1], steps[-1][1]
    rows = [first._replace(drive=neutral), *(command for _, command in steps), last._replace(drive=neutral)]
    times = np.concatenate([[0.0, presteer_s], presteer_s + np.cumsum([duration for duration, _ in steps])])
    columns = np.array(rows, dtype=float)
    return Commands(times, columns[:, 0], columns[:, 1], columns[:, 2])


def falling(first: float, last: float) -> list[float]:
    """Return numbers from `first` down to `last`, a tenth less each.

    >>> falling(1.0, 0.8)
    [1.0, 0.9, 0.81, 0.8]
    >>> falling(2.0, 2.0)
    [2.0]
    """
    numbers = [first]
    while numbers[-1] > last:
        numbers.append(max(last, round(0.9 * numbers[-1], 3)))
    return numbers
