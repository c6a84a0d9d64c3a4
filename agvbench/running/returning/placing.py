"""How a vehicle came to its start."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Placing:
    """How a vehicle came to its start: time taken [s], ways driven, and how far off it was seen at rest [m, rad]."""

    duration_s: float
    attempts: int
    position_error_m: float
    heading_error_rad: float

    def columns(self) -> dict[str, object]:
        """Return what a campaign's runs table says of it."""
        return {f"placing_{name}": value for name, value in vars(self).items()}
