"""How far anything may go before the vehicle is stopped."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SafetyLimits:
    """Limits of a run under way.

    ``watch_s`` [s] is how often frames are looked at; a simulated vehicle may get commands for ``control_cycle_s`` [s]
    at a time, and its motion is looked at afterwards in slices of ``watch_s``. ``lost_s`` [s] is how long the vehicle
    may go unseen, ``frozen_s`` [s] how long a camera that is never quite still may say the very same pose of a vehicle
    that was commanded to drive, ``jump_m`` [m] how far a vehicle may be from where it was going, ``clock_s`` [s] how
    far a camera's clock may be off. ``braking_s`` [s] is how long it takes to come to rest (thesis 8.1: 0.59 s), at
    half its speed on average: so far ahead of the edge the stop is commanded. ``flickers`` says that the camera is
    known to be never quite still, as every real one is.
    """

    watch_s: float = 0.1
    control_cycle_s: float = 0.1
    lost_s: float = 0.5
    frozen_s: float = 0.5
    jump_m: float = 0.3
    clock_s: float = 0.1
    braking_s: float = 0.59
    flickers: bool = False


DEFAULT_SAFETY = SafetyLimits()
