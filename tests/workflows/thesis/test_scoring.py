"""Scores against the rows, the null, and what picking the best combination can and cannot claim."""

import statistics

import pytest

from agvbench.thesis.prediction.assumptions import Assumptions
from agvbench.thesis.prediction.end_pose import predict
from agvbench.thesis.prediction.scoring import (
    ScoredRow,
    groups,
    median_errors,
    prediction_section,
    score,
    score_against_null,
    score_all,
)
from agvbench.thesis.prediction.sensitivity import best, combinations, sensitivity_section, shared_only
from agvbench.thesis.prediction.turns import MeasuredTurn, backward_factors, measured_turns
from agvbench.thesis.tables import MeasuredRow


def row(measured, predicted, null=0.0, has_sign=False, quantity="delta_s_mm"):
    return ScoredRow(
        MeasuredRow(1, "calibrated", quantity, measured, measured - 1, measured + 1), predicted, null, has_sign
    )


def test_unsigned_rows_are_compared_as_magnitudes_and_the_other_sign_is_shown():
    assert (row(10.0, -12.0).error, row(10.0, -12.0).other_sign, row(10.0, -12.0).null_error) == (2.0, 22.0, 10.0)
    turn = row(93.0, 95.0, null=90.0, has_sign=True, quantity="delta_heading_deg")
    assert (turn.error, turn.other_sign, turn.null_error) == (2.0, 2.0, 3.0)
    assert row(10.0, -10.5).in_quartiles
    assert not row(10.0, -12.0).in_quartiles


def test_all_28_rows_in_eight_groups():
    rows = score_all(Assumptions())
    assert len(rows) == 28
    assert {r.group for r in rows} == set(groups())
    assert [sum(r.group == g for r in rows) for g in groups()] == [2, 2, 4, 4, 4, 4, 4, 4]


def test_null_errors_are_the_printed_medians():
    null = median_errors(score_all(Assumptions()), "null_error")
    assert null["calibrated", "turn", "delta_s_mm"] == pytest.approx(statistics.median([8.0, 55.5, 9.6, 62.9]))
    assert null["uncalibrated", "turn", "delta_heading_deg"] == pytest.approx(statistics.median([13.1, 8.1, 9.5, 7.2]))


def test_nothing_of_chapter_8_enters_a_prediction(monkeypatch):
    """Predictions stay the same with other measurements; only their errors change."""
    before = [r.predicted for r in score_all(Assumptions())]
    from agvbench.thesis.prediction import scoring

    invented = tuple(
        MeasuredRow(r.measured.trajectory, r.measured.condition, r.measured.quantity, 500.0, 1.0, 999.0)
        for r in score_all(Assumptions())
    )
    monkeypatch.setattr(scoring, "end_pose_rows", lambda: invented)
    assert [r.predicted for r in scoring.score_all(Assumptions())] == before


def test_equal_errors_score_one():
    assert score_against_null([row(10.0, 20.0), row(4.0, 0.0, quantity="delta_heading_deg")]) == pytest.approx(1.0)


def test_best_is_not_worse_than_the_assumed_set_on_its_own_rows():
    for condition in ("uncalibrated", "calibrated"):
        assert best(condition).against_null <= score_against_null(score(Assumptions(), condition))
        assert any(c.assumed == Assumptions() for c in combinations(condition))


def test_what_is_carried_over_holds_nothing_of_one_condition_alone():
    carried = shared_only(Assumptions(whole_degrees="rounded", calibrated_drive="table_7_4", steering="front"))
    assert carried == Assumptions(steering="front")


def test_post_hoc_choice_on_uncalibrated_does_not_carry_over():
    """The lesson of the section: what fits one condition best makes the other worse than the null."""
    section = sensitivity_section()
    table = next(t for t in section.tables if t.name == "sensitivity_post_hoc").records()
    chosen = next(r for r in table if r["chosen_on"] == "uncalibrated")
    assert chosen["chosen_there"] < 0.6
    assert chosen["chosen_checked"] > chosen["as_assumed_checked"]


def test_ranges_hold_the_assumed_prediction():
    table = next(t for t in sensitivity_section().tables if t.name == "sensitivity_ranges").records()
    assert len(table) == 28
    by_key = {(r["trajectory"], r["condition"], r["quantity"]): r for r in table}
    for scored in score_all(Assumptions()):
        quantity = "Δs [mm]" if scored.measured.quantity == "delta_s_mm" else "heading [deg]"
        found = by_key[scored.measured.trajectory, scored.measured.condition, quantity]
        assert found["lowest"] <= abs(scored.predicted) <= found["highest"]


def test_prediction_section_counts_what_its_rows_say():
    section = prediction_section()
    rows = next(t for t in section.tables if t.name == "prediction_rows").records()
    assert section.values["rows_closer_than_null"] == sum(r["error"] < r["null_error"] for r in rows)
    summary = next(t for t in section.tables if t.name == "prediction_summary").records()
    assert {r["closer"] for r in summary} <= {"prediction", "even", "null"}


def test_half_speed_is_what_the_cubic_gets_wrong():
    from agvbench.thesis.prediction.trajectories import EIGHT

    cubic = predict(EIGHT[2], "calibrated", Assumptions())
    table = predict(EIGHT[2], "calibrated", Assumptions(calibrated_drive="table_7_4"))
    assert cubic.delta_s_mm > 90.0
    assert abs(table.delta_s_mm) < 10.0


def test_arc_of_a_measured_turn():
    radius, length = MeasuredTurn(5, "calibrated", 0.0, 90.0).arc(1)
    assert radius == pytest.approx(1000.0)
    assert length == pytest.approx(1570.796, abs=1e-3)
    assert len(measured_turns()) == 8


def test_no_single_backward_factor_serves_both_conditions():
    factors = backward_factors(Assumptions())
    assert factors["uncalibrated"] == pytest.approx(0.80, abs=0.02)
    assert factors["calibrated"] == pytest.approx(0.94, abs=0.02)
