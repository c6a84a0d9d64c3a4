"""The quantities that tables and comparisons are about, each with its definition."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A column of the table of errors, with how it is written and how fine it is worth printing.

    ``symbol`` names the signed value, ``name`` its magnitude.
    """

    column: str
    symbol: str
    unit: str
    name: str
    digits: int

    @property
    def labelled(self) -> str:
        """Return the name of the magnitude with its unit, short enough for a column headed "error"."""
        thesis = " (thesis)" if self.column == "delta_s_mm" else ""
        return f"{self.name.removeprefix('end ').removesuffix(' error')}{thesis} [{self.unit}]"


POSITION = Quantity("position_mm", "end position error", "mm", "end position error", 1)
ALONG = Quantity("along_mm", "along", "mm", "|along|", 1)
ACROSS = Quantity("across_mm", "across", "mm", "|across|", 1)
HEADING = Quantity("delta_heading_deg", "heading error", "deg", "heading error", 2)
DISTANCE = Quantity("delta_s_mm", "Δs", "mm", "|Δs|", 1)
ROTATION = Quantity("rotation_deg", "rotation", "deg", "rotation", 2)

QUANTITIES = (POSITION, HEADING, DISTANCE)
"""What tables of end poses show and comparisons test."""
END_POSE = (POSITION, HEADING)
"""What a lab means by the error of a run: these decide what is better or worse."""
COMPONENTS = (ALONG, ACROSS, HEADING)
"""The signed components of an end pose's error, whose biases are tested."""
THESIS = (DISTANCE, HEADING)
"""What the thesis reports; its Δδ is the heading error."""

DEFINITIONS = (
    "End position error: distance of the end position from the target position, both in the start frame. "
    "Heading error: heading change minus that of the target; the thesis calls it Δδ. "
    "Δs, as in the thesis: distance from start to end minus distance from start to target; "
    "it hardly changes when a run ends to the left or right of its target. "
    "Rotation: measured change of heading, positive in the direction of the target's. "
    "Medians are of magnitudes, biases of signed values."
)
COMPONENT_DEFINITIONS = "Along and across: end position minus target position along x and y of the start frame."
