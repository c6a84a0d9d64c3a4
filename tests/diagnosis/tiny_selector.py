"""Selectors for runs of the vehicle of a few lines, without the search for effects."""

from __future__ import annotations

from collections.abc import Iterable

from tiny_vehicle import HEADER

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.diagnosis.selection.stepwise import Selector
from agvbench.types import Run


def selector_of(runs: Iterable[Run], header: HeaderLike = HEADER) -> Selector:
    """Return the selector of a diagnosis of all `runs`."""
    method = RunsFromRest(DiagnosisContext(header, header.geometry, None, 0), lambda line: None)
    return method.selector(method.read(list(runs)))
