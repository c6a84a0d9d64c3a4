"""The table of end poses in the thesis' form, with the thesis' own values (tables 8.3–8.10) beside it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.resources import resource_directory
from agvbench.statistics.descriptive import classify_outliers, five_numbers
from agvbench.statistics.quantities import DISTANCE, HEADING, POSITION, ROTATION, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import CONDITIONS, Pose, wrap_angle

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
        for name, runs in valid(errors).groupby("trajectory", sort=False)
        for row in _trajectory_rows(str(name), runs, published)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def in_order(conditions: Iterable[str]) -> list[str]:
    """Return the distinct conditions, the known ones first in their usual order."""
    found = list(dict.fromkeys(map(str, conditions)))
    return [c for c in CONDITIONS if c in found] + [c for c in found if c not in CONDITIONS]


def _trajectory_rows(name: str, errors: pd.DataFrame, published: _Published) -> Iterator[dict[str, Any]]:
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


CASES: dict[int, Pose] = {
    1: Pose(2.0, 0.0, 0.0),
    2: Pose(-2.0, 0.0, 0.0),
    3: Pose(2.0, 0.0, 0.0),
    4: Pose(-2.0, 0.0, 0.0),
    5: Pose(1.0, 1.0, math.pi / 2),
    6: Pose(1.0, -1.0, -math.pi / 2),
    7: Pose(-1.0, 1.0, -math.pi / 2),
    8: Pose(-1.0, -1.0, math.pi / 2),
}
_NUMBER = re.compile(r"(?<![0-9.])([1-8])(?![0-9.])")


def thesis_case(trajectory: str, target: Pose) -> int | None:
    """Return which of the thesis' eight trajectories `trajectory` is, or None.

    It is case n if n is the first number from 1 to 8 in its name and its target is that of case n within 20 mm and 1°:
    the target alone cannot distinguish full from half speed.

    >>> thesis_case("case_5_forward_left", Pose(1.0, 1.0, math.pi / 2)), thesis_case("slalom_5", Pose(3.0, 0.0, 0.0))
    (5, None)
    """
    found = _NUMBER.search(trajectory)
    if found is None:
        return None
    case = CASES[int(found.group(1))]
    near = math.dist(case[:2], target[:2]) < 0.02
    aligned = abs(wrap_angle(case.heading_rad - target.heading_rad)) < math.radians(1.0)
    return int(found.group(1)) if near and aligned else None


def published_end_poses() -> pd.DataFrame:
    """Return tables 8.3–8.10, one row per trajectory, quantity and condition.

    Columns ``trajectory``, ``quantity`` (``delta_s_mm``, ``delta_heading_deg``), ``condition``, ``min``, ``q1``,
    ``median``, ``q3``, ``max``. The heading rows of trajectories 5 to 8 give the rotation made (about 90°).
    """
    import pandas as pd

    path = resource_directory("reports") / "reference" / "thesis" / "tables_8_3_to_8_10_end_pose.csv"
    return pd.read_csv(path).rename(columns={"vehicle": "condition"})
