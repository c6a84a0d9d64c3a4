"""The two quantities that tables and comparisons are about."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A column of the table of errors, with how it is written and how fine it is worth printing."""

    column: str
    symbol: str
    unit: str
    name: str
    digits: int


DISTANCE = Quantity("delta_s_mm", "Δs", "mm", "distance", 1)
HEADING = Quantity("delta_heading_deg", "Δδ", "deg", "heading", 2)
QUANTITIES = (DISTANCE, HEADING)
