"""Latency of the motion capture system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.types import Floats


@dataclass(frozen=True)
class MocapLatency(Effect):
    """The pose stamped t was true at t − latency."""

    name: ClassVar[str] = "mocap_latency"
    stage: ClassVar[Stage] = Stage.CAMERA
    relaxes: ClassVar[str] = "the motion capture system is exact (3.2)"
    reference: ClassVar[str] = "clock offset between camera and command computer"
    limits: ClassVar[str] = (
        "where runs start and end at rest it cannot be distinguished from actuation_delay: "
        "that needs a common reference of time"
    )
    remedy: ClassVar[str] = (
        "compare the time stamps of camera and commands with a common clock, and check the filters of the "
        "motion capture software"
    )

    latency_s: float = parameter(unit="s", low=-0.5, high=2.0, scale=0.05)

    @staticmethod
    def capture(state: Floats, time_s: float, latency_s: float) -> float:
        """Return the earlier time of the pose."""
        return time_s - latency_s
