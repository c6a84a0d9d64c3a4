"""Rules of a gate: limits on a statistic of a metric, as text and as TOML."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from agvbench.errors import FileError, FlagError, OneOf
from agvbench.metrics.registry import named_metric
from agvbench.text_files import read_toml
from agvbench.types import Floats
from agvbench.validation import convert

Statistic = Callable[[Floats], Floats]
STATISTICS: Mapping[str, Statistic] = {
    "median": lambda values: np.median(values, axis=-1),
    "mean": lambda values: np.mean(values, axis=-1),
    "p95": lambda values: np.percentile(values, 95.0, axis=-1),
    "max": lambda values: np.max(values, axis=-1),
    "bias": lambda values: np.mean(values, axis=-1),
    "sd": lambda values: np.std(values, axis=-1) * np.sqrt(values.shape[-1] / max(1, values.shape[-1] - 1)),
}
"""Statistics over repeats, along the last axis: of absolute values, those in `SIGNED` of signed ones."""
SIGNED = frozenset({"bias", "sd"})
TWO_SIDED = frozenset({"bias"})
"""Statistics whose limits hold in both directions: a vehicle may drift to either side."""
SHIFTED = ("median", "mean", "bias")
"""Statistics that move as much as all values do: their growth may be limited in standard deviations of a repeat."""
_RULE = re.compile(
    r"(?P<metric>\w+)\.(?P<statistic>\w+)\s*>\s*(?P<plus>\+?)(?P<limit>\d+(?:\.\d+)?)\s*(?P<unit>%|[^\d\s%+.-]\S*)?"
)
_EXAMPLE = "write METRIC.STATISTIC>LIMIT, such as position_error.p95>+10% or cross_track_rms.median>12mm"


@dataclass(frozen=True)
class GateRule:
    """A limit on a statistic of a metric over the repeats of each trajectory and condition.

    Parameters
    ----------
    text
        As it was written.
    metric, statistic
        Names.
    limit
        In `unit`: that of the metric, ``"%"``, or ``"sd"`` for standard deviations of the earlier campaign's repeats.
    metric_unit
        The unit of the metric.
    is_growth
        Whether the limit is on the growth since the earlier campaign.
    trajectories, conditions
        To which it applies; none for all.
    """

    text: str
    metric: str
    statistic: str
    limit: float
    unit: str
    metric_unit: str
    is_growth: bool
    trajectories: Collection[str] = ()
    conditions: Collection[str] = ()

    @classmethod
    def parse(cls, text: str, *, where: str = "--fail-on") -> GateRule:
        """Return the rule in `text`; `where` begins error messages.

        Raises
        ------
        FlagError
            If it is no rule, or metric, statistic or unit are unknown.

        Examples
        --------
        >>> GateRule.parse("position_error.p95>+10%").is_growth
        True
        """
        match = _RULE.fullmatch(text.strip())
        if match is None:
            raise FlagError("is no rule of a gate", where=where, value=text, remedy=_EXAMPLE)
        metric, statistic = named_metric(match["metric"], where=where), match["statistic"]
        if statistic not in STATISTICS:
            raise FlagError("unknown statistic", where=where, value=statistic, limit=OneOf(STATISTICS))
        unit = match["unit"] or metric.unit
        if unit not in ("%", "sd", metric.unit):
            remedy = f"write {match['limit']}{metric.unit}"
            raise FlagError(
                "has another unit than its metric", where=where, value=text, limit=metric.unit, remedy=remedy
            )
        if unit in ("%", "sd") and not match["plus"]:
            remedy = f"write >+{match['limit']}{unit}"
            raise FlagError(f"a limit in {unit} is a growth", where=where, value=text, remedy=remedy)
        if unit == "sd" and statistic not in SHIFTED:
            raise FlagError("a limit in sd is on another statistic", where=where, value=text, limit=OneOf(SHIFTED))
        return cls(text.strip(), metric.name, statistic, float(match["limit"]), unit, metric.unit, bool(match["plus"]))

    def with_repeats(self, sd: float) -> GateRule:
        """Return the rule with its limit in the metric's unit, where the standard deviation of a repeat was `sd`."""
        return replace(self, limit=self.limit * sd, unit=self.metric_unit) if self.unit == "sd" else self

    def allowed(self, before: float, now: float = math.inf) -> float:
        """Return the value of the statistic up to which it is allowed where it was `before`; of two, that nearer `now`.

        A limit on growth in both directions is one on each side of `before`.
        """
        share = abs(before) * self.limit / 100.0 if self.unit == "%" else self.limit
        if self.statistic in TWO_SIDED:
            centre = before if self.is_growth else 0.0
            return centre + math.copysign(share, now - centre)
        return before + share if self.is_growth else self.limit

    def is_exceeded(self, before: float, now: float) -> bool:
        """Return whether the statistic `now` is beyond what is allowed where it was `before`."""
        allowed = self.allowed(before, now)
        if self.statistic not in TWO_SIDED:
            return now > allowed
        centre = before if self.is_growth else 0.0
        return abs(now - centre) > abs(allowed - centre)

    def applies_to(self, trajectory: str, condition: str) -> bool:
        """Return whether it limits this trajectory and condition."""
        return (not self.trajectories or trajectory in self.trajectories) and (
            not self.conditions or condition in self.conditions
        )


class _RuleTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    fail_on: str
    trajectories: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()


class _GateFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    schema: Literal[1]
    rules: Annotated[tuple[_RuleTable, ...], msgspec.Meta(min_length=1)]


def read_gate(path: Path) -> list[GateRule]:
    """Return the rules of a gate file (schema 1).

    Each table ``[[rules]]`` has ``fail_on``, and optionally lists of ``trajectories`` and ``conditions``.

    Raises
    ------
    FileError
        If the file cannot be read, or a rule in it cannot be used.
    """
    try:
        file = convert(read_toml(path), _GateFile, where=str(path))
    except OSError as error:
        raise FileError("cannot be read", where=path, value=error.strerror) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"is not TOML ({error})", where=path, remedy="correct the line") from None
    return [
        replace(
            GateRule.parse(rule.fail_on, where=f"{path}: rules[{k}].fail_on"),
            trajectories=rule.trajectories,
            conditions=rule.conditions,
        )
        for k, rule in enumerate(file.rules)
    ]
