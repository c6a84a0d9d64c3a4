"""Budgets as tables: one row per budget, one row per component."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from agvbench.statistics.uncertainty.budget import Component, Role
from agvbench.statistics.uncertainty.end_pose_budgets import EndPoseBudget

if TYPE_CHECKING:
    import pandas as pd

_KEYS = ("trajectory", "condition", "quantity", "unit")
BUDGET_COLUMNS = (
    *(*_KEYS, "repeats", "mean", "combined", "degrees_of_freedom", "coverage_factor", "expanded", "low", "high"),
    "not_stated",
)
_OF_COMPONENT = (
    *("source", "evaluation", "distribution", "standard_uncertainty", "source_unit", "sensitivity"),
    *("contribution", "degrees_of_freedom", "role", "remark"),
)
COMPONENT_COLUMNS = (*_KEYS, *_OF_COMPONENT)


def budget_table(budgets: Sequence[EndPoseBudget]) -> pd.DataFrame:
    """Return one row per budget: mean, combined standard uncertainty, degrees of freedom, k, U and mean ± U for 95 %.

    One run has neither k nor U. ``not_stated`` counts the sources that the combined uncertainty lacks.
    """
    import pandas as pd

    rows = [(*_keys(one), one.repeats, *_result(one)) for one in budgets]
    return pd.DataFrame(rows, columns=list(BUDGET_COLUMNS))


def component_table(budgets: Sequence[EndPoseBudget]) -> pd.DataFrame:
    """Return one row per component of each budget, those that are not stated too (NaN)."""
    import pandas as pd

    rows = [(*_keys(one), *_component(c)) for one in budgets for c in one.budget.components]
    return pd.DataFrame(rows, columns=list(COMPONENT_COLUMNS))


def budgets_to_json(budgets: Sequence[EndPoseBudget]) -> str:
    """Return budgets with their components as JSON (schema 1); numbers that are not finite become null."""
    content = [
        dict(zip(BUDGET_COLUMNS, map(_finite, (*_keys(one), one.repeats, *_result(one))), strict=True))
        | {"components": [dict(zip(_OF_COMPONENT, map(_finite, _component(c)), strict=True)) for c in parts]}
        for one in budgets
        for parts in [one.budget.components]
    ]
    return json.dumps({"schema": 1, "budgets": content}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _keys(one: EndPoseBudget) -> tuple[str, ...]:
    return one.trajectory, one.condition, one.quantity.name, one.budget.unit


def _result(one: EndPoseBudget) -> Iterator[float]:
    budget = one.budget
    mean, expanded = budget.estimate, budget.expanded
    yield from (mean, budget.combined, budget.degrees_of_freedom, budget.coverage_factor, expanded)
    yield from one.interval
    yield sum(c.role is Role.NOT_STATED for c in budget.components)


def _component(c: Component) -> tuple[Any, ...]:
    numbers = c.standard_uncertainty, c.unit, c.sensitivity, c.contribution, c.degrees_of_freedom
    return c.source, c.evaluation, c.distribution, *numbers, str(c.role), c.remark
