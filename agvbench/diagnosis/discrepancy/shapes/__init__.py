"""Shapes of every discrepancy term, by what they act on."""

from __future__ import annotations

from agvbench.diagnosis.discrepancy.shapes.base import Evidence, Option, Shapes
from agvbench.diagnosis.discrepancy.shapes.camera import camera_shapes
from agvbench.diagnosis.discrepancy.shapes.changes import changes_with_time
from agvbench.diagnosis.discrepancy.shapes.floor import floor_shapes
from agvbench.diagnosis.discrepancy.shapes.motion import motion_shapes
from agvbench.diagnosis.discrepancy.shapes.steering import steering_shapes


def every_shape(of: Evidence) -> Shapes:
    """Yield each term with its shapes: regressors, and the function that composes parameters."""
    for shapes in (floor_shapes, camera_shapes, motion_shapes, steering_shapes, changes_with_time):
        yield from shapes(of)


__all__ = ["Evidence", "Option", "Shapes", "every_shape"]
