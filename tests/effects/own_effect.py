"""The file of an effect that is not in the library, to be spoilt in one place."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TEXT = '''"""Lateral load slows the vehicle down."""

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects import Effect, Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, YAW_RATE
from agvbench.types import Floats


def half(value: float) -> float:
    return 0.5 * value


@dataclass(frozen=True)
class LateralLoadLoss(Effect):
    """Speed falls with the lateral load: ``v ← v (1 − loss |u ψ̇|)``."""

    name: ClassVar[str] = "lateral_load_loss"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "speed does not depend on steering (7.4)"
    reference: ClassVar[str] = "a test"
    limits: ClassVar[str] = "none"

    loss: float = parameter(unit="s²/m", low=0.0, high=5.0, scale=0.5)

    @staticmethod
    def move(state: Floats, loss: float) -> None:
        """Reduce the speed."""
        kept = 1.0 - loss * abs(state[FORWARD] * state[YAW_RATE])
        state[FORWARD] *= kept
        state[LEFT] *= kept
'''


def write(folder: Path, old: str = "", new: str = "") -> Path:
    """Write ``effects/lateral_load_loss.py`` in `folder` with `old` replaced by `new`; return the file."""
    assert old in TEXT
    path = folder / "effects" / "lateral_load_loss.py"
    path.parent.mkdir(exist_ok=True)
    path.write_text(TEXT.replace(old, new) if old else TEXT, encoding="utf-8")
    return path


PROGRAM = """
import numpy as np
from agvbench.model import example_vehicle
from agvbench.effects import effect_kinds
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry
run = SimulatedRun(Commands(*np.array([[0.0], [1000.0], [1300.0], [1500.0]])), np.array([0.0, 0.1]))
simulation = Simulation(Geometry(0.2, 0.1), Command(1500.0, 1500.0, 1500.0), [run])
settled, start = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.3]]), np.zeros((1, 4))
slower = simulation.parameters([effect_kinds()["lateral_load_loss"](loss=1.0)])
for parameters in (simulation.parameters(), slower):
    print(np.hypot(*simulation.predict(settled, parameters, start)[-1, :2]))
"""
"""Prints how far the vehicle drives in a turn without and with the effect."""


def python(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python in `folder`."""
    return subprocess.run([sys.executable, *command], cwd=folder, capture_output=True, text=True, check=False)
