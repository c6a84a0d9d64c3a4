"""Table of the residuals before and after, step by step, with their covariates."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.result import Diagnosis
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

FEATURES = ("speed", "sideways", "turning")
COVARIATES = (
    "time_in_run_s", "speed_mps", "curvature_per_m", "direction", "campaign_time_h", "x_m", "y_m", "heading_rad",
    "course_rad",
)  # fmt: skip


def residual_table(readings: Readings, held: NDArray[np.bool_], before: Floats, after: Floats) -> pd.DataFrame:
    """Return one row per step between samples of a run.

    Columns: ``run_id``, ``held_out``, the covariates of `COVARIATES`, ``length_m``, and for each feature ``before_…``
    and ``after_…``: ``speed`` and ``sideways`` (longitudinal and lateral) as shares of the distance, ``turning`` in
    rad/m. Steps without a counterpart in the other prediction are left out.

    Parameters
    ----------
    readings
        R runs of K samples.
    held
        (R,): mask of the test runs.
    before, after
        (R, K, 3): predicted poses.
    """
    import pandas as pd

    tables = []
    for name, poses in (("before", before), ("after", after)):
        rates = residual_rates(readings, poses)
        values = {f"{name}_{feature}": rates.value[:, k] for k, feature in enumerate(FEATURES)}
        own = {"run": rates.run, "time_in_run_s": rates.covariates["time_in_run_s"], **values}
        if name == "after":
            own |= {key: rates.covariates[key] for key in COVARIATES} | {"length_m": rates.weight}
        tables.append(pd.DataFrame(own))
    merged = tables[0].merge(tables[1], on=["run", "time_in_run_s"])
    index = merged.pop("run").to_numpy()
    merged.insert(0, "run_id", [readings.runs[i].run_id for i in index])
    merged.insert(1, "held_out", held[index])
    return merged


def with_residuals(
    found: Diagnosis, readings: Readings, held: NDArray[np.bool_], before: Floats, after: Floats
) -> Diagnosis:
    """Return `found` with the table of its residuals."""
    return dataclasses.replace(found, residuals=residual_table(readings, held, before, after))
