"""A comparison as JSON (schema 1)."""

from __future__ import annotations

import math
from typing import Any

from agvbench.statistics.bootstrap import CONFIDENCE
from agvbench.statistics.comparison import Comparison
from agvbench.statistics.differences import Difference, Sample
from agvbench.statistics.end_shifts import EndShift
from agvbench.statistics.quantities import POSITION
from agvbench.statistics.words import describe, headline

SCHEMA = 1


def comparison_to_json(comparison: Comparison) -> dict[str, Any]:
    """Return `comparison` as what `json.dumps` takes; numbers that are not finite become null."""
    return {
        "schema": SCHEMA,
        "a": comparison.name_a,
        "b": comparison.name_b,
        "regression": comparison.is_regression,
        "could_compare": comparison.could_compare,
        "headline": headline(comparison),
        "alpha": comparison.alpha,
        "tests": comparison.tests,
        "trajectories": [
            {"trajectory": trajectory, "condition": condition, "verdict": str(verdict)}
            for (trajectory, condition), verdict in comparison.verdicts.items()
        ],
        "differences": [_difference(d, comparison) for d in comparison.differences],
        "end_shifts": [_shift(shift) for shift in comparison.shifts],
        "left_out": list(comparison.left_out),
        "notes": list(comparison.notes),
    }


def _difference(d: Difference, comparison: Comparison) -> dict[str, Any]:
    return {
        "trajectory": d.trajectory,
        "condition": d.condition,
        "quantity": d.quantity.column if d.quantity is POSITION else f"abs_{d.quantity.column}",
        "unit": d.quantity.unit,
        "margin": d.margin,
        "a": _sample(d.a),
        "b": _sample(d.b),
        "difference": _finite(d.interval.estimate),
        "interval": {"low": _finite(d.interval.low), "high": _finite(d.interval.high), "confidence": CONFIDENCE},
        "p_worse": d.p_worse,
        "p_better": d.p_better,
        "p_same": d.p_same,
        "cliffs_delta": d.cliffs_delta,
        "smallest_visible_difference": _finite(d.visible),
        "verdict": str(d.verdict),
        "decides": d.decides,
        "words": describe(d, comparison),
    }


def _shift(shift: EndShift) -> dict[str, Any]:
    parts = {"along_mm": shift.along, "across_mm": shift.across}
    return {
        "trajectory": shift.trajectory,
        "condition": shift.condition,
        **{
            name: {"difference": part.estimate, "low": _finite(part.low), "high": _finite(part.high)}
            for name, part in parts.items()
        },
    }


def _sample(sample: Sample) -> dict[str, Any]:
    return {
        "repeats": sample.repeats,
        "median": _finite(sample.median),
        "sd": _finite(sample.sd),
        "outliers": sample.outliers,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
