"""Uncertainty budgets after the GUM, pose accuracy and repeatability after ISO 9283, completed attempts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from agvbench.campaign.uncertainty_statement import HOW_TO_STATE
from agvbench.reporting.content import Block, Column, Fold, Paragraph, Table, Value
from agvbench.reporting.sections.base import Section
from agvbench.statistics.uncertainty.end_pose_budgets import key_to_state
from agvbench.statistics.uncertainty.propagation import SOURCES
from agvbench.statistics.uncertainty.tables import budget_table, component_table
from agvbench.workflows.report import ReportData

_KEYS = (
    Column("trajectory", "trajectory"),
    Column("condition", "condition"),
)
_BUDGET = (
    *_KEYS,
    Column("quantity", "mean of"),
    Column("unit", "unit"),
    Column("repeats", "n", 0, explained="Repeats that count."),
    Column("mean", "mean", 3),
    Column("combined", "u", 3, explained="Combined standard uncertainty of the mean; of one run: of the camera only."),
    Column("degrees_of_freedom", "ν", 1, explained="Effective degrees of freedom after Welch and Satterthwaite."),
    Column(
        "coverage_factor",
        "k",
        2,
        explained="For 95 %, from Student's t with ν; assumes a nearly normal result (JCGM 100, G.6.5).",
    ),
    Column(
        "expanded",
        "U = k·u",
        3,
        explained="Expanded uncertainty: the true mean lies within ± U with 95 %. One run has none.",
    ),
    Column("low", "from", 3, group="mean ± U", explained="A distance is not negative: not below zero."),
    Column("high", "to", 3, group="mean ± U"),
    Column(
        "not_stated",
        "not stated",
        0,
        explained="Sources that u lacks: not stated by the lab, or not known from these runs.",
    ),
)
_COMPONENTS = (
    *_KEYS,
    Column("quantity", "mean of"),
    Column("source", "source"),
    Column("evaluation", "type", explained="A: by statistics of repeated observations. B: by other means."),
    Column("distribution", "distribution"),
    Column("standard_uncertainty", "standard uncertainty", 4),
    Column("source_unit", "unit"),
    Column(
        "sensitivity",
        "sensitivity",
        4,
        explained="Change of the mean per change of the source, over 1.96 standard uncertainties.",
    ),
    Column("contribution", "contribution", 4, explained="Sensitivity times standard uncertainty [mm or deg]."),
    Column("degrees_of_freedom", "ν", 1),
    Column("role", "role"),
    Column("value", "remark"),
)
_ACCURACY = (
    *_KEYS,
    Column("repeats", "n", 0),
    Column("ap_mm", "AP [mm]", 2, group="position", explained="From the target to the mean end position."),
    Column("mean_radius_mm", "mean radius [mm]", 2, group="position"),
    Column("rp_mm", "RP [mm]", 2, group="position", explained="Mean radius about the mean end position + 3 S."),
    Column("ap_deg", "AP [deg]", 2, group="heading", explained="Mean heading error."),
    Column("rp_deg", "RP ± [deg]", 2, group="heading", explained="3 standard deviations of the heading error."),
)
_COMPLETIONS = (
    *_KEYS,
    Column("attempts", "attempts", 0),
    Column("not_completed", "not completed", 0, explained="Left the workspace, did not come to rest, or was aborted."),
    Column(
        "left_out",
        "no attempt",
        0,
        explained="Ended by camera, operator or installation, rejected for the recording, or without an end pose.",
    ),
    Column("bound", "not completed with a probability of at most [%]", 1),
)
_NOTE = (
    "Evaluated after JCGM 100:2008 (GUM). Noise of the camera at the rest poses is in the scatter of repeats, and is "
    "not added to it, except by how much it enlarges distances. Repeats of one session count as independent; what is "
    "the same in every run enters as far as it is stated. The budget is of the mean; other tables have medians. "
    "The mean end position error is the mean of distances, and not AP, the distance of the mean position. The heading "
    "error is signed here; other tables show magnitudes."
)
_NOTE_ACCURACY = (
    "Terms and formulas of ISO 9283, which tests manipulators; ISO 18646-2 measures pose accuracy and repeatability of "
    "mobile service robots, too. AP is the distance from the commanded position to the mean of the attained ones. RP "
    "is the mean distance of the attained positions from their mean, plus three times the standard deviation S of this "
    "distance. ISO 9283 drives 30 cycles; fewer give too small an RP, and fewer than three none."
)
_NOTE_COMPLETIONS = (
    "The exact one-sided 95 % bound after Clopper and Pearson: with no failure in n attempts it is 1 − 0.05^(1/n), "
    "such as 26 % for 10 of 10 and 5 % for 59 of 59. ASTM F3244 (navigation of unmanned ground vehicles in a defined "
    "area) asks for statistically significant results of repeated tests, too; this table is not a test after F3244."
)
_NOT_STATED = (
    Column("source", "source"),
    Column("value", "how to state it"),
    Column("position", "effect on position [mm]", 4, explained="Largest change of a mean per unit of the source."),
    Column("heading", "on heading [deg]", 4),
    Column("unit", "per"),
)


class UncertaintySection(Section):
    """Budgets with their components, what is not stated, AP and RP, and completed attempts."""

    slug, title, order = "uncertainty", "Uncertainty", 72

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the tables, or why there are none."""
        if not data.budgets:
            return [Paragraph("No run has a target and a measured end pose.")]
        caption = "Mean end pose errors with their expanded uncertainty, 95 %."
        budgets = Table("uncertainty", caption, _BUDGET, _rows(budget_table(data.budgets), _BUDGET), True, _NOTE)
        components = component_table(data.budgets)
        parts = [c for one in data.budgets for c in one.budget.components]
        is_shown = [key_to_state(c) is None for c in parts]
        components = components[is_shown].assign(value=components["remark"])
        shown = Table(
            "uncertainty-components", "Components of each budget.", _COMPONENTS, _rows(components, _COMPONENTS), True
        )
        accuracy = Table(
            "pose-accuracy", "Pose accuracy AP and pose repeatability RP.", _ACCURACY,
            _rows(data.accuracy, _ACCURACY), note=_NOTE_ACCURACY,
        )  # fmt: skip
        completed = data.completions.assign(bound=100.0 * data.completions["failure_bound"])
        completions = Table(
            "completions", "Completed attempts.", _COMPLETIONS, _rows(completed, _COMPLETIONS), note=_NOTE_COMPLETIONS
        )
        folded = Fold("Components of each budget", [shown])
        return [budgets, folded, *_not_stated(data), accuracy, completions]


def _rows(frame: object, columns: Sequence[Column]) -> list[list[Value]]:
    records = frame.to_dict("records")  # type: ignore[attr-defined]
    return [[row[column.name] for column in columns] for row in records]


def _not_stated(data: ReportData) -> Iterator[Table]:
    """Yield a table of what a lab could state, with the largest effect of each source on any mean."""
    largest: dict[str, dict[str, float]] = {}
    for one in data.budgets:
        for c in one.budget.components:
            if (key := key_to_state(c)) is not None:
                by_unit = largest.setdefault(key, {"mm": math.nan, "deg": math.nan})
                by_unit[one.budget.unit] = max(abs(c.sensitivity), by_unit[one.budget.unit])
    rows: list[list[Value]] = [
        [SOURCES[key][0], f"{key} = …", found["mm"], found["deg"], SOURCES[key][1]] for key, found in largest.items()
    ]
    if rows:
        note = f"Write them under [uncertainty] into lab.toml or campaign.toml ({HOW_TO_STATE})."
        yield Table("not-stated", "Sources of uncertainty that the lab does not state.", _NOT_STATED, rows, note=note)
