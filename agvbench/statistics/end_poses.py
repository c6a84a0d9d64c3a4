"""The table of end poses in the thesis' form, with the thesis' own values beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.statistics.outliers import classify_outliers
from agvbench.statistics.published import published_end_poses, thesis_case
from agvbench.statistics.quantities import QUANTITIES, Quantity
from agvbench.statistics.quartiles import five_numbers
from agvbench.statistics.runs import valid
from agvbench.types import CONDITIONS, Pose

if TYPE_CHECKING:
    import pandas as pd

STATISTICS = ("min", "q1", "median", "q3", "max")
_Published = dict[tuple[Any, ...], dict[Any, Any]]
COLUMNS = (
    *("trajectory", "case", "quantity", "reading", "condition", "repeats", *STATISTICS, "outliers"),
    *(f"published_{name}" for name in STATISTICS),
)


def end_pose_table(errors: pd.DataFrame) -> pd.DataFrame:
    """Return MIN, Q1, MED, Q3 and MAX per trajectory, quantity and condition (thesis tables 8.3–8.10).

    ``reading`` says what the row gives: ``|Δs|`` [mm], ``|Δδ|`` [deg], or, for trajectories that turn, the measured
    ``rotation`` [deg] as in tables 8.7–8.10. ``case`` and the ``published_…`` columns are empty (NaN) where
    the trajectory is not one of the thesis' eight.

    Parameters
    ----------
    errors
        What `pose_errors` returns.
    """
    import pandas as pd

    keys = ["trajectory", "quantity", "condition"]
    published = {tuple(row[key] for key in keys): row for row in published_end_poses().to_dict("records")}
    rows = [
        row
        for name in dict.fromkeys(errors["trajectory"])
        for row in _trajectory_rows(str(name), valid(errors[errors["trajectory"] == name]), published)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def in_order(conditions: pd.Series) -> list[str]:
    """Return the distinct conditions, the known ones first in their usual order."""
    found = [str(condition) for condition in dict.fromkeys(conditions)]
    return [c for c in CONDITIONS if c in found] + [c for c in found if c not in CONDITIONS]


def _trajectory_rows(name: str, errors: pd.DataFrame, published: _Published) -> Iterator[dict[str, Any]]:
    if errors.empty:
        return
    target = Pose(*errors[["target_x_m", "target_y_m", "target_heading_rad"]].iloc[0])
    case = thesis_case(name, target)
    for quantity in QUANTITIES:
        for condition in in_order(errors["condition"]):
            group = errors[errors["condition"] == condition]
            reading, values = _reading(group, quantity, turns=abs(target.heading_rad) > 0.01)
            row: dict[str, Any] = {"trajectory": name, "case": case, "quantity": quantity.column, "reading": reading}
            row |= {"condition": condition, "repeats": len(values)}
            row |= dict(zip(STATISTICS, five_numbers(values), strict=True))
            row |= {"outliers": classify_outliers(values).count}
            yield row | _published(published, case, quantity, condition)


def _reading(group: pd.DataFrame, quantity: Quantity, *, turns: bool) -> tuple[str, np.ndarray[Any, Any]]:
    if turns and quantity.column == "delta_heading_deg":
        return "rotation", group["rotation_deg"].to_numpy(dtype=float)
    return f"|{quantity.symbol}|", group[quantity.column].abs().to_numpy(dtype=float)


def _published(published: _Published, case: int | None, quantity: Quantity, condition: str) -> dict[str, float]:
    key = (case, quantity.column, condition)
    return {f"published_{name}": published[key][name] for name in STATISTICS} if key in published else {}
