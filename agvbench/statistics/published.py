"""The thesis' end poses (tables 8.3–8.10), and which trajectory they belong to."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from agvbench.resources import resource_directory
from agvbench.types import Pose, wrap_angle

if TYPE_CHECKING:
    import pandas as pd

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
    the target alone cannot tell full from half speed.

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
