"""Uncertainties that a lab states and no run shows: ``[uncertainty]`` of ``campaign.toml`` and ``lab.toml``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec

from agvbench.errors import CampaignError, FileError
from agvbench.validation import convert

_Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
_Freedom = Annotated[float, msgspec.Meta(ge=1.0, le=1e6)]
HOW_TO_STATE = "docs/reference/report.md#uncertainty"


class Stated(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is stated of one source: a standard uncertainty, or the half-width of limits (a rectangular distribution).

    ``degrees_of_freedom`` say how reliable a standard uncertainty is; without them it counts as exactly known.
    """

    standard: _Positive | None = None
    half_width: _Positive | None = None
    degrees_of_freedom: _Freedom | None = None


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    camera_position_mm: _Positive | Stated | None = None
    camera_scale_ppm: _Positive | Stated | None = None
    camera_heading_deg: _Positive | Stated | None = None
    marker_offset_mm: _Positive | Stated | None = None
    heading_alignment_deg: _Positive | Stated | None = None
    clock_ms: _Positive | Stated | None = None


@dataclass(frozen=True)
class Evaluation:
    """A type B evaluation: standard uncertainty, the distribution behind it, and its degrees of freedom.

    The standard uncertainty of limits ± a is a/√3 (JCGM 100:2008, 4.3.7).
    """

    standard_uncertainty: float
    distribution: str
    degrees_of_freedom: float = math.inf


def evaluate(stated: float | Stated) -> Evaluation:
    """Return the evaluation that a value of the table stands for.

    >>> evaluate(0.3)
    Evaluation(standard_uncertainty=0.3, distribution='normal', degrees_of_freedom=inf)
    >>> round(evaluate(Stated(half_width=3.0)).standard_uncertainty, 3)
    1.732
    """
    if not isinstance(stated, Stated):
        return Evaluation(stated, "normal")
    freedom = stated.degrees_of_freedom or math.inf
    if stated.half_width is not None:
        return Evaluation(stated.half_width / math.sqrt(3.0), "rectangular", freedom)
    return Evaluation(stated.standard or 0.0, "normal", freedom)


def read_statement(table: object, where: Path | str, error: type[FileError | CampaignError]) -> dict[str, Any]:
    """Return the table ``[uncertainty]`` after checking it: values by key, as TOML has them.

    Raises
    ------
    FileError, or `error`
        If it has an unknown key or a value that cannot be used.
    """
    checked = convert(table, _Table, where=f"{where}: uncertainty", error=error, remedy=f"see {HOW_TO_STATE}")
    for key in _Table.__struct_fields__:
        stated = getattr(checked, key)
        if isinstance(stated, Stated) and (stated.standard is None) is (stated.half_width is None):
            raise error(
                "states neither or both of standard and half_width",
                where=f"{where}: uncertainty.{key}",
                value=msgspec.to_builtins(stated),
                remedy=f"give one of them; see {HOW_TO_STATE}",
            )
    return {key: value for key, value in msgspec.to_builtins(checked).items() if value is not None}


def evaluations(table: object) -> dict[str, Evaluation]:
    """Return the evaluations by key of a table that `read_statement` returned."""
    checked = msgspec.convert(table, _Table)
    found = {key: getattr(checked, key) for key in _Table.__struct_fields__}
    return {key: evaluate(stated) for key, stated in found.items() if stated is not None}
