"""The eight turns looked at afterwards: both signs of Δs, and how much steering arrived. Post hoc throughout."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import mean, median

from agvbench.thesis.prediction.assumptions import Assumptions
from agvbench.thesis.prediction.end_pose import EndPosePrediction, predict_all
from agvbench.thesis.prediction.scoring import CONDITIONS
from agvbench.thesis.section import Cell, ThesisSection, ThesisTable
from agvbench.thesis.tables import end_pose_rows

TARGET_MM = 1000.0 * math.sqrt(2.0)


@dataclass(frozen=True)
class MeasuredTurn:
    """Medians of one turn: Δs without its sign [mm] and the heading turned [deg]."""

    number: int
    condition: str
    delta_s_mm: float
    turned_deg: float

    def arc(self, sign: int) -> tuple[float, float]:
        """Return (radius, length) [mm] of the circular arc that the medians imply if Δs had `sign`."""
        turned = math.radians(self.turned_deg)
        radius = (TARGET_MM + sign * self.delta_s_mm) / (2.0 * math.sin(turned / 2.0))
        return radius, radius * turned


def measured_turns() -> tuple[MeasuredTurn, ...]:
    """Return the eight measured turns, uncalibrated first."""
    found = {(r.trajectory, r.condition, r.quantity): r.median for r in end_pose_rows()}
    return tuple(
        MeasuredTurn(n, c, found[n, c, "delta_s_mm"], found[n, c, "delta_heading_deg"])
        for c in CONDITIONS
        for n in (5, 6, 7, 8)
    )


def _predicted_turns(assumed: Assumptions) -> dict[tuple[int, str], EndPosePrediction]:
    return {(p.trajectory.number, c): p for c in CONDITIONS for p in predict_all(assumed, c) if p.trajectory.is_turn}


def heading_ratios(assumed: Assumptions) -> dict[tuple[int, str], float]:
    """Return heading turned, measured over predicted, per (trajectory, condition)."""
    predicted = _predicted_turns(assumed)
    return {
        (t.number, t.condition): t.turned_deg / abs(predicted[t.number, t.condition].turned_deg)
        for t in measured_turns()
    }


def backward_factors(assumed: Assumptions) -> dict[str, float]:
    """Return per condition the mean factor on the heading of the backward turns 7 and 8."""
    ratios = heading_ratios(assumed)
    return {c: mean(ratios[n, c] for n in (7, 8)) for c in CONDITIONS}


def carried_over(assumed: Assumptions) -> list[tuple[Cell, ...]]:
    """Return per condition the backward heading errors [deg]: as predicted, with the other's factor, of the null."""
    factors, predicted = backward_factors(assumed), _predicted_turns(assumed)
    rows: list[tuple[Cell, ...]] = []
    for condition, other in zip(CONDITIONS, reversed(CONDITIONS), strict=True):
        turns = [t for t in measured_turns() if t.condition == condition and t.number >= 7]
        amounts = [abs(predicted[t.number, condition].turned_deg) for t in turns]
        plain = median(abs(a - t.turned_deg) for a, t in zip(amounts, turns, strict=True))
        scaled = median(abs(factors[other] * a - t.turned_deg) for a, t in zip(amounts, turns, strict=True))
        null = median(abs(90.0 - t.turned_deg) for t in turns)
        rows.append((condition, factors[condition], other, factors[other], plain, scaled, null))
    return rows


def turns_section() -> ThesisSection:
    """Return both readings of every turn, and the factor on backward turns checked across conditions."""
    assumed = Assumptions()
    ratios = heading_ratios(assumed)
    readings = tuple(
        (t.number, t.condition, t.turned_deg, t.delta_s_mm, *t.arc(1), *t.arc(-1), ratios[t.number, t.condition])
        for t in measured_turns()
    )
    columns: tuple[str, ...] = ("trajectory", "condition", "turned [deg]", "Δs [mm]", "radius if + [mm]")
    columns += ("length if + [mm]", "radius if − [mm]", "length if − [mm]", "measured / predicted")
    narrow = ("no.", "condition", "turned [deg]", "Δs [mm]", "radius +", "length +", "radius −", "length −", "ratio")
    carried = carried_over(assumed)
    carried_columns: tuple[str, ...] = ("condition", "own factor", "factor from", "factor", "error as predicted [deg]")
    carried_columns += ("error with that factor [deg]", "null [deg]")
    tables = (
        ThesisTable("turns_readings", "Both readings of the turns", columns, readings, narrow_columns=narrow),
        ThesisTable("turns_backward", "One factor on backward headings, carried over", carried_columns, tuple(carried)),
    )
    factors = backward_factors(assumed)
    return ThesisSection("turns", "The turns, afterwards (post hoc)", _findings(ratios, factors), tables, dict(factors))


def _findings(ratios: dict[tuple[int, str], float], factors: dict[str, float]) -> tuple[str, ...]:
    forward = {c: mean(ratios[n, c] for n in (5, 6)) for c in CONDITIONS}
    return (
        (
            "Chapter 8 calls case 6 'backward movement'; it is the forward right turn. What stands out is not the "
            f"direction but the side: calibrated right turns (6, 8) miss by {_errors(6, 8)} mm, left turns (5, 7) by "
            f"{_errors(5, 7)} mm, forward and backward alike."
        ),
        (
            "Δs has two readings per turn. If + a right turn's arc is wider and longer than asked, if − tighter and "
            "shorter; the medians alone do not show which."
        ),
        (
            f"Headings turned, measured over predicted: forward {forward['uncalibrated']:.2f} uncalibrated and "
            f"{forward['calibrated']:.2f} calibrated, backward {factors['uncalibrated']:.2f} and "
            f"{factors['calibrated']:.2f}. No single factor for driving backward serves both conditions; lag, gain "
            "and backlash cannot be distinguished here."
        ),
    )


def _errors(*numbers: int) -> str:
    found = {t.number: t.delta_s_mm for t in measured_turns() if t.condition == "calibrated"}
    return " and ".join(f"{found[n]:.1f}" for n in numbers)
