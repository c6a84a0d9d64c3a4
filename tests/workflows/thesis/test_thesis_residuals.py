"""From residual to effect: the small formulas here are independent of the package's own fits."""

import math

import numpy as np
import pytest

from agvbench.cli import main
from agvbench.thesis.added_effects import CAUSES, asymmetry_with, checks, fitted, mean_error, predicted, rows_with
from agvbench.thesis.prediction.assumptions import Assumptions
from agvbench.thesis.prediction.end_pose import predict_all
from agvbench.thesis.prediction.scoring import CONDITIONS
from agvbench.thesis.refits.idle_axle import arm_across_tables
from agvbench.thesis.residuals import kinematics_alone, traced
from agvbench.thesis.tables import drive_table, endurance_table, steering_table


def _of(name):
    return next(t for t in traced() if t.name == name)


def test_every_residual_shrinks_on_what_was_left_out():
    for t in traced():
        assert len(t.at) == len(t.residual_before) == len(t.residual_after) >= 9
        assert t.rms_after < 0.65 * t.rms_before


def test_the_straight_lines_errors_are_those_of_least_squares():
    table = steering_table("front")
    x, y = table.pulse_us, table.median_deg
    missed = []
    for k in range(1, len(x) - 1):
        kept = [i for i in range(1, len(x) - 1) if i != k]
        slope, level = np.polyfit(x[kept], y[kept], 1)
        missed.append(y[k] - slope * x[k] - level)
    np.testing.assert_allclose(_of("steering_front").residual_before, missed, atol=1e-6)


def test_constant_speed_and_droop_are_those_of_the_other_intervals():
    start_s, speed = endurance_table()
    t = _of("battery")
    for k in range(len(speed)):
        others = np.delete(np.arange(len(speed)), k)
        assert t.residual_before[k] == pytest.approx(1000.0 * (speed[k] - speed[others].mean()))
        line = np.polyval(np.polyfit(start_s[others], speed[others], 1), start_s[k])
        assert t.residual_after[k] == pytest.approx(1000.0 * (speed[k] - line))


def test_drive_pulses_left_out_are_all_but_the_outermost():
    np.testing.assert_array_equal(_of("drive").at, drive_table()[0][1:-1])


def test_kinematics_explain_part_of_appendix_b_and_the_loss_more():
    t = _of("cornering")
    assert t.rms_before > kinematics_alone() > t.rms_after > t.floor


def test_one_lever_arm_serves_both_tables_and_one_coupling_does_not():
    for plain, lever, coupled in arm_across_tables().values():
        assert lever < 0.7 * plain
        assert coupled > plain


def test_no_cause_leaves_the_prediction_as_it_was():
    for condition in CONDITIONS:
        for mine, theirs in zip(
            predicted(None, 0.0, condition, Assumptions()), predict_all(Assumptions(), condition), strict=True
        ):
            assert mine.delta_s_mm == pytest.approx(theirs.delta_s_mm, abs=1e-9)
            assert mine.turned_deg == pytest.approx(theirs.turned_deg, abs=1e-9)


@pytest.mark.parametrize("cause", CAUSES, ids=lambda c: c.name)
def test_each_cause_vanishes_at_zero_and_changes_something(cause):
    plain = [r.predicted for r in rows_with(None, 0.0)]
    np.testing.assert_allclose([r.predicted for r in rows_with(cause, 0.0)], plain, atol=1e-9)
    assert np.ptp(np.subtract([r.predicted for r in rows_with(cause, cause.high)], plain)) > 1.0


def test_a_curvature_turns_a_straight_by_its_length():
    cause = next(c for c in CAUSES if c.name == "wheel_diameter_mismatch")
    plain, bent = (predicted(cause, v, "calibrated", Assumptions())[0] for v in (0.0, 0.05))
    length = math.hypot(plain.end.x_m, plain.end.y_m)
    assert math.radians(bent.turned_deg - plain.turned_deg) == pytest.approx(0.05 * length, rel=0.01)


def test_a_fit_is_the_best_value_on_its_own_rows():
    cause = CAUSES[0]
    value, rows = fitted(cause, lambda r: r.measured.condition == "uncalibrated")
    own = mean_error(r for r in rows if r.measured.condition == "uncalibrated")
    for other in np.linspace(cause.low, cause.high, 9):
        found = mean_error(r for r in rows_with(cause, float(other)) if r.measured.condition == "uncalibrated")
        assert own <= found + 1e-12
    assert cause.low <= value <= cause.high


def test_what_carries_over_is_said_both_ways_and_the_asymmetry_stays_unexplained():
    carried = [c for c in checks() if c.carries_over]
    for c in carried:
        assert all(c.after[k] < c.before[k] for k in CONDITIONS)
        measured, _, after = asymmetry_with(c)
        assert after < 0.5 * measured


def test_the_command_shows_the_section_and_draws_it(tmp_path, capsys):
    assert main(["thesis", "--section", "residuals", "--figures", str(tmp_path / "f")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "7 of 7 residuals shrink on what was left out" in said
    files = sorted(p.name for p in (tmp_path / "f").iterdir())
    assert files == sorted(f"thesis-{t.name.replace('_', '-')}.svg" for t in traced())
    text = (tmp_path / "f" / "thesis-battery.svg").read_text(encoding="utf-8")
    assert "battery_droop" in text
