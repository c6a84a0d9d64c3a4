"""Section 8.1's endurance run: what a drained battery costs, and whether a line describes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.thesis.section import Figure, ThesisSection, ThesisTable, figures_table
from agvbench.thesis.tables import endurance_percentiles, endurance_table, rms
from agvbench.types import Floats

ENDURANCE_S = 29877.0
TRAJECTORY_RUN_S = 7.0


@dataclass(frozen=True)
class Droop:
    """``v = initial_mps · (1 − per_hour · hours)``."""

    initial_mps: float
    per_hour: float

    def __call__(self, hours: Floats) -> Floats:
        """Return the speed [m/s] after `hours`."""
        return self.initial_mps * (1.0 - self.per_hour * hours)


def fit_droop(hours: Floats, speed_mps: Floats) -> Droop:
    """Return the least squares line through table 8.2."""
    slope, initial = np.polyfit(hours, speed_mps, 1)
    return Droop(float(initial), float(-slope / initial))


def held_out_errors() -> tuple[Floats, Floats]:
    """Return the errors [m/s] of every interval predicted from the ten others: by their mean, and by a line."""
    start_s, speed = endurance_table()
    hours = start_s / 3600.0
    others = [np.arange(len(hours)) != i for i in range(len(hours))]
    constant = np.array([speed[i] - speed[k].mean() for i, k in enumerate(others)])
    line = np.array([speed[i] - fit_droop(hours[k], speed[k])(hours[i]) for i, k in enumerate(others)])
    return constant, line


def battery_section() -> ThesisSection:
    """Return the refit of tables 8.1 and 8.2 beside the text's figures."""
    start_s, speed = endurance_table()
    droop = fit_droop(start_s / 3600.0, speed)
    constant, line = (1000.0 * rms(e) for e in held_out_errors())
    percent = 100.0 * droop.per_hour
    percentiles = endurance_percentiles()
    figures = [
        Figure("last speed below the highest [%]", "8.1", "7.6", 100.0 * float(1.0 - speed[-1] / speed.max())),
        Figure("length of the test [h] (8 h 18 min)", "8.1", "8.3", ENDURANCE_S / 3600.0),
        Figure("positions at 10 Hz", "8.1", "298770", 10.0 * ENDURANCE_S),
        Figure(
            "end of the test [s], after the eleventh interval's start",
            "table 8.2",
            "29877",
            float(start_s[-1]),
            "eleven intervals 3000 s apart do not fit into 29 877 s",
        ),
        Figure(
            "median of the intervals [m/s]",
            "table 8.1",
            f"{percentiles[50]:.3f}",
            float(np.median(speed)),
            "11 samples against 298 770, tracking peaks left in",
        ),
    ]
    held_out = ThesisTable(
        "battery_held_out",
        "Table 8.2: each interval predicted from the others",
        ("model", "held-out rms [mm/s]"),
        (("constant speed (thesis 3.2)", constant), ("linear droop", line)),
    )
    findings = (
        (
            f"The battery costs {percent:.2f} % of speed per hour: a line through table 8.2 predicts a left-out "
            f"interval to {line:.1f} mm/s, a constant to {constant:.1f}."
        ),
        (
            f"Within one drive of {TRAJECTORY_RUN_S:.0f} s that is {20.0 * percent * TRAJECTORY_RUN_S / 3600.0:.2f} "
            f"mm of 2 m, but {20.0 * percent:.0f} mm between drives an hour apart: harmless only if conditions are "
            "interleaved."
        ),
    )
    return ThesisSection(
        "battery",
        "Battery (tables 8.1 and 8.2)",
        findings,
        (figures_table("battery", "Endurance run", figures), held_out),
        {
            "droop_per_hour": droop.per_hour,
            "initial_speed_mps": droop.initial_mps,
            "held_out_rms_constant_mm_per_s": constant,
            "held_out_rms_linear_mm_per_s": line,
        },
    )
