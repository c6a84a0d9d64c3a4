"""Smoothing of poses, with its latency."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import SEEN_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class MocapLatencySmoothing(Variant):
    """The pose m stamped t is a filter's output for the poses q up to t − latency: ``ṁ = (q − m) / time_constant_s``.

    A window of free driving begins with the lag of a steady motion.
    """

    name: ClassVar[str] = "mocap_latency_smoothing"
    variant_of: ClassVar[str] = "mocap_latency"
    stage: ClassVar[Stage] = Stage.CAMERA
    relaxes: ClassVar[str] = "the motion capture system is exact (3.2)"
    reference: ClassVar[str] = "first-order low-pass filter, as trackers offer against jitter"
    limits: ClassVar[str] = (
        "at a constant speed it cannot be distinguished from mocap_latency; a moving average looks like both"
    )
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        # A slow motion is seen later by both.
        "mocap_latency.latency_s": {"latency_s": 1.0, "time_constant_s": 1.0}
    }

    latency_s: float = parameter(unit="s", low=-0.5, high=2.0, scale=0.05)
    time_constant_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with all of the library's latency by smoothing, and with half of it."""
        late = fitted["latency_s"]
        return [((1.0 - share) * late, max(0.0, share * late)) for share in (1.0, 0.5)]

    @staticmethod
    def capture(state: Floats, time_s: float, latency_s: float, time_constant_s: float) -> float:
        """Return the earlier time of the pose."""
        return time_s - latency_s

    @staticmethod
    def see(state: Floats, latency_s: float, time_constant_s: float) -> None:
        """Set the time constant of smoothing."""
        state[SEEN_LAG] = time_constant_s
