"""The stages of a vehicle without effects, which do nothing.

`agvbench.model.simulation.compose` replaces these functions by calls of the hooks of all effects.
"""

from __future__ import annotations

from agvbench.model.compiled import compiled
from agvbench.types import Floats


@compiled(inner=True)
def arrive(s: Floats, time_s: float, p: Floats) -> float:
    """Return when a command given at `time_s` takes effect."""
    return time_s


@compiled(inner=True)
def aim(s: Floats, p: Floats) -> None:
    """Change the aims of the actuators under a command, and their dynamics."""


@compiled(inner=True)
def adopt(s: Floats, p: Floats) -> None:
    """Change what effects remember of the commands by the measured yaw rate with which a simulation begins."""


@compiled(inner=True)
def steer(s: Floats, p: Floats) -> None:
    """Change the axles' angles."""


@compiled(inner=True)
def drive(s: Floats, p: Floats) -> None:
    """Change the axles' speeds."""


@compiled(inner=True)
def move(s: Floats, p: Floats) -> None:
    """Change the body's motion."""


@compiled(inner=True)
def drift(s: Floats, p: Floats) -> None:
    """Change the velocity in the floor frame."""


@compiled(inner=True)
def capture(s: Floats, time_s: float, p: Floats) -> float:
    """Return when the pose stamped `time_s` was true."""
    return time_s


@compiled(inner=True)
def see(s: Floats, p: Floats) -> None:
    """Change the pose that the camera reports."""
