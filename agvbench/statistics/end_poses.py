"""The table of end poses in the thesis' form, with the thesis' own values beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.statistics.outliers import classify_outliers
from agvbench.statistics.published import published_end_poses, thesis_case
from agvbench.statistics.quantities import DISTANCE, HEADING, POSITION, ROTATION, Quantity
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


def end_pose_table(errors: pd.DataFrame, *, thesis_vehicle: bool = True) -> pd.DataFrame:
    """Return MIN, Q1, MED, Q3 and MAX per trajectory, quantity and condition (thesis tables 8.3–8.10).

    ``reading`` says what the row gives: ``end position error`` [mm], ``heading error`` [deg], ``|Δs|`` [mm] and, for
    trajectories that turn, the measured ``rotation`` [deg] as in tables 8.7–8.10. ``case`` and the ``published_…``
    columns are empty (NaN) where the trajectory is not one of the thesis' eight, the latter also where the thesis has
    no such reading.

    Parameters
    ----------
    errors
        What `pose_errors` returns.
    thesis_vehicle
        Whether the thesis' vehicle was driven. What the thesis published is not set beside another vehicle's errors.
    """
    import pandas as pd

    keys = ["trajectory", "quantity", "condition"]
    known = published_end_poses().to_dict("records") if thesis_vehicle else []
    published = {tuple(row[key] for key in keys): row for row in known}
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
    turns = abs(target.heading_rad) > 0.01
    for quantity in (POSITION, HEADING, DISTANCE, *([ROTATION] if turns else [])):
        for condition in in_order(errors["condition"]):
            values = _values(errors[errors["condition"] == condition], quantity)
            row: dict[str, Any] = {"trajectory": name, "case": case, "quantity": quantity.column}
            row |= {"reading": quantity.name, "condition": condition, "repeats": len(values)}
            row |= dict(zip(STATISTICS, five_numbers(values), strict=True))
            row |= {"outliers": classify_outliers(values).count}
            yield row | _published(published, (case, _published_as(quantity, turns=turns), condition))


def _values(group: pd.DataFrame, quantity: Quantity) -> np.ndarray[Any, Any]:
    values = group[quantity.column].to_numpy(dtype=float)
    return values if quantity is ROTATION else np.abs(values)


def _published_as(quantity: Quantity, *, turns: bool) -> str:
    """Return under which quantity the thesis' tables have a row: for turns they give the rotation as the heading."""
    if turns and quantity in (HEADING, ROTATION):
        return HEADING.column if quantity is ROTATION else ""
    return quantity.column


def _published(published: _Published, key: tuple[int | None, str, str]) -> dict[str, float]:
    return {f"published_{name}": published[key][name] for name in STATISTICS} if key in published else {}
