"""Compare two sets of runs: where b is worse than a, and how sure that is.

Every comparison is a rank-sum test of end position error, heading error or |Δs|, exact for small samples. The first two
decide. Holm's correction covers all of them, so that two campaigns that do not differ report a regression with a chance
of at most 1 %, whatever their noise. |Δs|, as the thesis defines it, is a note, corrected by itself.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import FlagError
from agvbench.statistics.differences import (
    ALL,
    ALPHA,
    ComparisonVerdict,
    Difference,
    EndShift,
    decide_families,
    end_shift,
    overall,
    pooled_sd,
    raw_differences,
)
from agvbench.statistics.intervals import RESAMPLES
from agvbench.statistics.matching import Cell, Side, match_cells
from agvbench.statistics.quantities import END_POSE, QUANTITIES, Quantity
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

# What a lab would hardly act on: about a quarter of a per cent of a two-metre drive.
MARGIN_MM = 5.0
MARGIN_DEG = 1.0
_NOTHING: Mapping[Quantity, float] = MappingProxyType({})


@dataclass(frozen=True)
class Comparison:
    """All differences between two sets of runs, and what they do and do not mean.

    ``shifts`` say how the mean end position moved; no verdict follows from them. ``cautions`` say what is missing from
    the campaigns and what differs besides the errors (vehicle, plant, camera, trajectories, calibration); ``remarks``
    what the intervals cover. `notes` are both.
    """

    name_a: str
    name_b: str
    differences: tuple[Difference, ...]
    shifts: tuple[EndShift, ...]
    left_out: tuple[str, ...]
    remarks: tuple[str, ...]
    alpha: float
    tests: int
    cautions: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what qualifies the verdicts, as ``agvbench compare`` prints it; the most severe first."""
        return (*self.cautions, *self.remarks)

    def __repr__(self) -> str:
        from agvbench.statistics.comparison_summary import headline

        return f"<Comparison of {self.name_b} with {self.name_a}: {headline(self)}>"

    @property
    def deciding(self) -> list[Difference]:
        """Return the differences that decide whether something is worse; the others are notes."""
        return [difference for difference in self.differences if difference.decides]

    def of(self, verdict: ComparisonVerdict) -> list[Difference]:
        """Return the differences that decide and have this verdict."""
        return [difference for difference in self.deciding if difference.verdict is verdict]

    @property
    def verdicts(self) -> dict[tuple[str, str], ComparisonVerdict]:
        """Return the verdict on each trajectory and condition, by the differences that decide."""
        found: dict[tuple[str, str], list[ComparisonVerdict]] = {}
        for d in self.deciding:
            found.setdefault((d.trajectory, d.condition), []).append(d.verdict)
        return {cell: overall(verdicts) for cell, verdicts in found.items()}

    @property
    def noted_worse(self) -> list[Difference]:
        """Return the notes that say worse of a trajectory and condition whose verdict does not."""
        verdicts = self.verdicts
        return [
            d
            for d in self.differences
            if not d.decides
            and d.verdict is ComparisonVerdict.WORSE
            and verdicts[d.trajectory, d.condition] is not ComparisonVerdict.WORSE
        ]

    @property
    def worst_first(self) -> list[Difference]:
        """Return the differences for reading: trajectories with the worst first, in each the end position first.

        Worse comes before undecided, same and better, and in each the largest first, in multiples of the margin.
        """
        order = (
            ComparisonVerdict.WORSE,
            ComparisonVerdict.INCONCLUSIVE,
            ComparisonVerdict.SAME,
            ComparisonVerdict.BETTER,
        )
        worst: dict[tuple[str, str], tuple[int, float]] = {}
        for d in self.deciding:
            rank = order.index(d.verdict), -d.interval.estimate / (d.margin or 1.0)
            cell = d.trajectory, d.condition
            worst[cell] = min(rank, worst.get(cell, rank))
        return sorted(self.differences, key=lambda d: worst[d.trajectory, d.condition])

    @property
    def has_several_conditions(self) -> bool:
        """Whether trajectories were compared under more than one condition, so that rows must name theirs."""
        return len({d.condition for d in self.differences if d.trajectory != ALL}) > 1

    def differences_frame(self) -> pd.DataFrame:
        """Return one row per difference, worst first.

        Columns: ``trajectory``, ``condition``, ``quantity`` in ``unit``; ``repeats_a``, ``median_a``, ``repeats_b``,
        ``median_b``; ``difference`` of medians, b minus a, with its 95 % interval ``low`` … ``high``; ``margin``;
        ``verdict`` and whether it ``decides``; ``p_worse``, ``p_better`` (corrected) and ``cliffs_delta``.

        Errors are magnitudes, so that a positive ``difference`` is worse. ``cliffs_delta`` is P(b > a) − P(b < a), from
        −1 to 1; positive is worse, and ``p_worse`` is small then.

        With several trajectories or conditions, each quantity has a row of trajectory ``"all trajectories"`` and
        condition ``"all"``: all of them tested together. Its medians and its ``difference`` are means over
        trajectories and conditions; its p-values and ``cliffs_delta`` count in how many pairs of repeats of one
        trajectory and condition b is larger. Many small increases and few large decreases therefore give a negative
        ``difference`` with a positive ``cliffs_delta``. A worse or better needs both to agree. To leave these rows out:
        ``frame[frame["trajectory"] != "all trajectories"]``.
        """
        from agvbench.statistics.comparison_summary import differences_frame

        return differences_frame(self)

    def _repr_html_(self) -> str:
        from agvbench.statistics.comparison_summary import comparison_html

        return comparison_html(self)

    @property
    def is_regression(self) -> bool:
        """Whether anything that decides is worse beyond its margin."""
        return bool(self.of(ComparisonVerdict.WORSE))

    @property
    def could_compare(self) -> bool:
        """Whether some difference could have been found, or every one was ruled out."""
        return any(d.testable for d in self.deciding) or not self.of(ComparisonVerdict.INCONCLUSIVE)


def compare_errors(
    a: pd.DataFrame,
    b: pd.DataFrame,
    *,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    conditions: tuple[str, str] | None = None,
    same_campaign: bool = False,
    deciding: Collection[Quantity] = END_POSE,
    further: Mapping[Quantity, float] = _NOTHING,
    names: tuple[str, str] = ("A", "B"),
    alpha: float = ALPHA,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Comparison:
    """Compare the errors of `b` with those of `a`: end position error, heading error and |Δs|.

    Parameters
    ----------
    a, b
        What `pose_errors` returns. Runs that were rejected or could not be measured do not count.
    margin_mm, margin_deg
        The noise band, of end position error and |Δs|, and of the heading error: median differences within it are no
        regression, however significant.
    conditions
        Compare the first condition of `a` with the second of `b`; without it, equal conditions are compared.
    same_campaign
        `a` and `b` come from the same campaign, so that sessions of one name are the same session and runs are compared
        within it.
    deciding
        The quantities that decide whether something is worse, of end position error, heading error and |Δs|; the others
        are notes.
    further
        Further quantities, columns of `a` and `b`, with their margins; these decide, too.
    names
        What to call the two sides.
    alpha
        The chance of reporting any regression where there is none, over all trajectories and the quantities that
        decide; notes have the same chance of their own.
    resamples, seed
        Of the bootstrap.

    Raises
    ------
    InputError
        If there is nothing in common, or a side has no run that counts.
    FlagError
        If a margin is negative or not finite.
    """
    margins = checked_margins(margin_mm, margin_deg) | dict(further)
    cells, left_out = match_cells(a, b, conditions=conditions, same_campaign=same_campaign, quantities=tuple(margins))
    left_out += [
        f"{cell.trajectory} {cell.condition}: no {quantity.name}"
        for quantity in further
        for cell in cells
        if not cell.has(quantity)
    ]
    raw = raw_differences(cells, margins, resamples, seed)
    differences, tests = decide_families(raw, [*deciding, *further], alpha)
    shifts = sorted(map(end_shift, cells), key=lambda shift: -shift.length_mm)
    note = session_note(cells, same_campaign=same_campaign)
    return Comparison(*names, tuple(differences), tuple(shifts), tuple(left_out), (note,), alpha, tests)


def checked_margins(margin_mm: float, margin_deg: float) -> dict[Quantity, float]:
    """Return the margin of every quantity.

    Raises
    ------
    FlagError
        If one is negative or not finite.
    """
    margins = {"mm": margin_mm, "deg": margin_deg}
    for unit, value in margins.items():
        if not (math.isfinite(value) and value >= 0.0):
            limit = f"a finite number of {unit} ≥ 0"
            raise FlagError("margin cannot be used", where=f"--margin-{unit}", value=value, limit=limit)
    return {q: margins[q.unit] for q in QUANTITIES}


_WITHIN = "the intervals cover the variation within a session, not what changes from one session to the next"
_CAUSES = "re-mounted markers, battery, floor, a new calibration of the cameras"


def session_note(cells: Sequence[Cell], *, same_campaign: bool) -> str:
    """Return, in plain words, what the intervals of a comparison of these cells cover and what they do not."""
    if same_campaign:
        return f"Both sides were driven in the same campaign: {_WITHIN}."
    deviations = [between_sessions_sd(cells, quantity) for quantity in QUANTITIES]
    if all(map(math.isnan, deviations)):
        return (
            f"Each side is one session: {_WITHIN}. Whatever else changed between the two ({_CAUSES}) is part of the "
            "difference; only more sessions of each could separate it."
        )
    said = ", ".join(f"{sd:.{q.digits}f} {q.unit} ({q.name})" for sd, q in zip(deviations, QUANTITIES, strict=True))
    return (
        f"Medians of sessions of one and the same side have a standard deviation of {said}: a difference "
        f"of that size between the sides may be a session's ({_CAUSES}), because {_WITHIN}."
    )


def between_sessions_sd(cells: Sequence[Cell], quantity: Quantity) -> float:
    """Return the standard deviation of session medians of the absolute error within one side; NaN with one session."""
    return pooled_sd([_session_medians(side, quantity) for cell in cells for side in (cell.a, cell.b)])


def _session_medians(side: Side, quantity: Quantity) -> Floats:
    return np.array([float(np.median(side.values(quantity, session))) for session in side.sessions])
