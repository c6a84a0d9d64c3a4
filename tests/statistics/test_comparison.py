"""What compare promises: hardly a false alarm, and no real shift of three standard deviations missed."""

import json
import math

import numpy as np
import pytest
from statistics_samples import TARGETS, error_table

from agvbench.errors import FlagError, InputError
from agvbench.statistics import ComparisonVerdict, compare_errors
from agvbench.statistics.comparison_summary import comparison_to_json, describe, headline
from agvbench.statistics.differences import ALL
from agvbench.statistics.quantities import QUANTITIES

PAIRS = 200


def normal(rng, sd=5.0):
    return lambda n: rng.normal(0.0, sd, n)


def heavy_tailed(rng, sd=5.0):
    return lambda n: sd * rng.standard_t(3, n) / math.sqrt(3.0)


def with_outliers(rng, sd=5.0):
    return lambda n: np.where(rng.random(n) < 0.1, 20.0, 1.0) * rng.normal(0.0, sd, n)


def find(comparison, trajectory, quantity="delta_s_mm", condition=None):
    return next(
        d
        for d in comparison.differences
        if d.trajectory == trajectory and d.quantity.column == quantity and condition in (None, d.condition)
    )


def alarms(draw, repeats, conditions):
    """Count the regressions that pairs of campaigns of one vehicle report."""
    bias = {(t, c): (12.0, 1.0) for t in TARGETS for c in conditions}
    make = {"repeats": repeats, "conditions": conditions, "shift": bias}
    pairs = ((error_table(draw, **make), error_table(draw, **make)) for _ in range(PAIRS))
    return sum(compare_errors(a, b, margin_mm=0.0, margin_deg=0.0, resamples=2).is_regression for a, b in pairs)


@pytest.mark.parametrize("repeats", [5, 10])
@pytest.mark.slow
def test_two_campaigns_of_the_same_vehicle_report_a_regression_in_at_most_two_percent(repeats):
    draw = heavy_tailed(np.random.default_rng(20 + repeats))
    assert alarms(draw, repeats, ("calibrated",)) <= 0.02 * PAIRS


@pytest.mark.slow
@pytest.mark.parametrize("repeats", [5, 10])
@pytest.mark.parametrize("noise", [normal, heavy_tailed, with_outliers])
def test_so_do_two_campaigns_under_two_conditions_each(noise, repeats):
    draw = noise(np.random.default_rng(50 + repeats))
    assert alarms(draw, repeats, ("uncalibrated", "calibrated")) <= 0.02 * PAIRS


@pytest.mark.parametrize(("noise", "least"), [(normal, 0.9), pytest.param(heavy_tailed, 0.85, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_shift_of_three_sd_in_one_of_twenty_eight_comparisons_is_found(noise, least):
    draw = noise(np.random.default_rng(31))
    base = {(t, c): (20.0, 2.0) for t in TARGETS for c in ("uncalibrated", "calibrated")}
    worse = base | {("6_forward_right", "calibrated"): (35.0, 2.0)}
    found = 0
    for _ in range(PAIRS // 4):
        comparison = compare_errors(
            error_table(draw, repeats=10, shift=base), error_table(draw, repeats=10, shift=worse), resamples=2
        )
        found += find(comparison, "6_forward_right", condition="calibrated").verdict is ComparisonVerdict.WORSE
    assert found >= least * PAIRS / 4


@pytest.mark.parametrize("repeats", [5, 10])
def test_a_shift_of_three_sd_everywhere_is_always_found(repeats):
    draw = heavy_tailed(np.random.default_rng(32))
    base = {(t, "calibrated"): (20.0, 2.0) for t in TARGETS}
    worse = {(t, "calibrated"): (35.0, 2.0) for t in TARGETS}
    make = {"repeats": repeats, "conditions": ("calibrated",)}
    found = sum(
        compare_errors(
            error_table(draw, shift=base, **make), error_table(draw, shift=worse, **make), resamples=2
        ).is_regression
        for _ in range(20)
    )
    assert found >= 19


def test_the_four_verdicts_and_their_words():
    rng = np.random.default_rng(33)
    base = {("1_forward", "calibrated"): (50.0, 5.0)}
    make = {"repeats": 10, "trajectories": ("1_forward", "2_backward"), "conditions": ("calibrated",)}
    a = error_table(normal(rng, 2.0), shift=base, **make)

    def against(mm, **options):
        b = error_table(normal(rng, 2.0), shift={("1_forward", "calibrated"): (50.0 + mm, 5.0)}, **make)
        comparison = compare_errors(a, b, **options)
        d = find(comparison, "1_forward")
        return d.verdict, describe(d, comparison)

    verdict, words = against(20.0)
    assert verdict is ComparisonVerdict.WORSE
    assert words.endswith(" mm worse")
    assert against(-20.0)[0] is ComparisonVerdict.BETTER
    assert against(0.0, margin_mm=5.0) == (ComparisonVerdict.SAME, "the same to within 5.0 mm")
    verdict, words = against(0.0, margin_mm=0.0)
    assert verdict is ComparisonVerdict.INCONCLUSIVE
    assert words.startswith("10 repeats cannot show a difference smaller than about ")
    # Significant, but its estimate lies inside the noise band, and repeats do not prove it to be inside either.
    assert against(6.0, margin_mm=7.0) == (
        ComparisonVerdict.INCONCLUSIVE,
        "worse, but perhaps by no more than the margin of 7.0 mm",
    )


@pytest.mark.parametrize("repeats", [5, 10])
def test_runs_that_end_further_left_are_a_regression_although_distance_and_heading_are_the_same(repeats):
    rng = np.random.default_rng(46)
    make = {"repeats": repeats, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a, b = (error_table(normal(rng, 2.0), **make) for _ in range(2))
    arc = 60.0 / 2000.0
    b["along_mm"] += 2000.0 * (math.cos(arc) - 1.0)
    b["across_mm"] += 2000.0 * math.sin(arc)
    b["position_mm"] = np.hypot(b["along_mm"], b["across_mm"])
    comparison = compare_errors(a, b)
    assert comparison.is_regression
    verdicts = {d.quantity.column: d.verdict for d in comparison.differences}
    assert [column for column, verdict in verdicts.items() if verdict is ComparisonVerdict.WORSE] == ["position_mm"]
    (shift,) = comparison.shifts
    assert shift.across.low < 60.0 < shift.across.high
    assert shift.along.covers(-0.9)
    assert shift.across.high - shift.across.low < 10.0


def further_along_and_less_across():
    """Return two sides of one trajectory: the second ends nearer to its target, at a distance that is more wrong."""
    rng = np.random.default_rng(50)
    make = {"repeats": 10, "trajectories": ("parallel_park", "1_forward"), "conditions": ("calibrated",)}
    return (
        error_table(normal(rng, 2.0), shift={("parallel_park", "calibrated"): (along, 0.0, across)}, **make)
        for along, across in ((80.0, 110.0), (90.0, 80.0))
    )


def test_distance_worse_alone_is_a_note_and_no_regression():
    comparison = compare_errors(*further_along_and_less_across())
    verdicts = {d.quantity.column: d.verdict for d in comparison.differences if d.trajectory == "parallel_park"}
    assert (verdicts["position_mm"], verdicts["delta_s_mm"]) == (ComparisonVerdict.BETTER, ComparisonVerdict.WORSE)
    assert not comparison.is_regression
    assert comparison.verdicts["parallel_park", "calibrated"] is not ComparisonVerdict.WORSE
    assert headline(comparison).endswith("is worse alone in parallel_park, which is no regression.")
    assert headline(comparison).startswith("No regression shown: of 6 comparisons 0 worse")
    made = comparison_to_json(comparison)
    assert [d["decides"] for d in made["differences"]] == [True, True, False] * 3
    assert made["tests"] == 6


def test_distance_counts_where_it_is_asked_to_and_shares_the_chance_of_a_false_alarm():
    comparison = compare_errors(*further_along_and_less_across(), deciding=QUANTITIES)
    assert comparison.is_regression
    assert comparison.verdicts["parallel_park", "calibrated"] is ComparisonVerdict.WORSE
    assert comparison.tests == 9
    assert "Note" not in headline(comparison)


def test_the_other_side_of_the_target_is_no_regression_and_is_shown():
    rng = np.random.default_rng(47)
    make = {"repeats": 10, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    right, left = (
        error_table(normal(rng, 2.0), shift={("1_forward", "calibrated"): (0.0, 0.0, across)}, **make)
        for across in (-30.0, 30.0)
    )
    comparison = compare_errors(right, left)
    assert not comparison.is_regression
    made = comparison_to_json(comparison)["end_shifts"][0]
    assert made["trajectory"] == "1_forward"
    assert made["across_mm"]["low"] < 60.0 < made["across_mm"]["high"]
    assert made["along_mm"]["low"] < 0.0 < made["along_mm"]["high"]


def test_rows_come_by_trajectory_the_worst_first_with_the_end_position_before_other_errors():
    rng = np.random.default_rng(48)
    shift = {("2_backward", "calibrated"): (40.0, 0.0), ("5_forward_left", "calibrated"): (80.0, 0.0)}
    make = {"repeats": 10, "trajectories": ("1_forward", "2_backward", "5_forward_left"), "conditions": ("calibrated",)}
    comparison = compare_errors(error_table(normal(rng), **make), error_table(normal(rng), shift=shift, **make))
    rows = [d for d in comparison.worst_first if d.trajectory != ALL]
    assert [d.trajectory for d in rows] == ["5_forward_left"] * 3 + ["2_backward"] * 3 + ["1_forward"] * 3
    assert [d.quantity.column for d in rows] == ["position_mm", "delta_heading_deg", "delta_s_mm"] * 3
    assert [d.trajectory for d in rows if d.verdict is ComparisonVerdict.WORSE] == ["5_forward_left"] * 2 + [
        "2_backward"
    ] * 2


def test_where_repeats_are_few_the_distance_is_not_tested_before_the_end_pose():
    rng = np.random.default_rng(49)
    make = {"repeats": 5, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a, b = (error_table(normal(rng), **make) for _ in range(2))
    assert all(d.testable for d in compare_errors(a, b).differences)  # |Δs| is a note, which costs the others nothing
    comparison = compare_errors(a, b, deciding=QUANTITIES)
    assert {d.quantity.column: d.testable for d in comparison.differences} == {
        "position_mm": True, "delta_heading_deg": True, "delta_s_mm": False,
    }  # fmt: skip
    assert "6 of each could" in describe(find(comparison, "1_forward"), comparison)


def test_too_few_repeats_are_said_aloud():
    rng = np.random.default_rng(34)
    make = {"repeats": 3, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a = error_table(normal(rng), **make)
    b = error_table(normal(rng), shift={("1_forward", "calibrated"): (500.0, 0.0)}, **make)
    comparison = compare_errors(a, b)
    assert not comparison.could_compare
    assert not comparison.is_regression
    assert headline(comparison) == (
        "Could not compare: 3 repeats cannot show any difference here, however large; 5 of each could."
    )


def test_a_difference_within_the_margin_is_no_regression_however_significant():
    rng = np.random.default_rng(35)
    make = {"repeats": 60, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a = error_table(normal(rng, 1.0), shift={("1_forward", "calibrated"): (50.0, 5.0)}, **make)
    b = error_table(normal(rng, 1.0), shift={("1_forward", "calibrated"): (53.0, 5.0)}, **make)
    assert compare_errors(a, b, margin_mm=1.0).is_regression
    wide = compare_errors(a, b, margin_mm=6.0)
    assert not wide.is_regression
    assert find(wide, "1_forward").verdict is ComparisonVerdict.SAME


def test_a_small_change_everywhere_shows_in_all_trajectories_together():
    rng = np.random.default_rng(36)
    conditions = ("calibrated",)
    base = {(t, "calibrated"): (30.0, 3.0) for t in TARGETS}
    worse = {(t, "calibrated"): (34.0, 3.0) for t in TARGETS}
    comparison = compare_errors(
        error_table(normal(rng), repeats=10, conditions=conditions, shift=base),
        error_table(normal(rng), repeats=10, conditions=conditions, shift=worse),
        margin_mm=2.0,
    )
    assert find(comparison, ALL).verdict is ComparisonVerdict.WORSE


def test_outliers_are_named_and_not_dropped():
    rng = np.random.default_rng(37)
    make = {"repeats": 10, "trajectories": ("1_forward",), "conditions": ("calibrated",)}
    a = error_table(normal(rng), **make)
    b = a.copy()
    b.loc[0, "delta_s_mm"] = 400.0
    d = find(compare_errors(a, b), "1_forward")
    assert d.b.outliers == "1 high severe"
    assert d.b.repeats == 10
    assert d.a.outliers == "none"


def test_conditions_are_compared_within_the_sessions_that_they_share():
    # Sessions differ by far more than the conditions do: only within a session can the difference be seen.
    rng = np.random.default_rng(38)
    make = {"repeats": 30, "trajectories": ("1_forward",)}
    table = error_table(normal(rng, 1.0), shift={("1_forward", "calibrated"): (6.0, 0.0)}, **make)
    table["session"] = [f"s{repeat % 3}" for repeat in table["repeat"]]
    table["delta_s_mm"] += 200.0 + 100.0 * (table["repeat"] % 3)
    blind = compare_errors(table, table, conditions=("uncalibrated", "calibrated"))
    assert find(blind, "1_forward").verdict is ComparisonVerdict.INCONCLUSIVE
    seen = compare_errors(table, table, conditions=("uncalibrated", "calibrated"), same_campaign=True)
    assert find(seen, "1_forward").verdict is ComparisonVerdict.WORSE
    assert find(seen, "1_forward").condition == "uncalibrated → calibrated"


def test_of_all_together_many_small_increases_outnumber_few_large_decreases():
    rng = np.random.default_rng(41)
    base = {(t, "calibrated"): (40.0, 4.0) for t in TARGETS}
    changed = dict.fromkeys(base, (43.0, 4.3)) | {("1_forward", "calibrated"): (5.0, 0.5)}
    a, b = (error_table(normal(rng, 0.2), repeats=8, conditions=("calibrated",), shift=s) for s in (base, changed))
    comparison = compare_errors(a, b, margin_mm=0.5, resamples=9)
    together = find(comparison, ALL, "position_mm")
    assert together.interval.estimate < -1.0
    assert together.cliffs_delta > 0.5
    assert together.p_worse < 0.001
    assert together.verdict not in {ComparisonVerdict.WORSE, ComparisonVerdict.BETTER}
    frame = comparison.differences_frame()
    alone = frame[(frame["trajectory"] != "all trajectories") & (frame["quantity"] == "position_mm")]
    assert (np.sign(alone["difference"]) == np.sign(alone["cliffs_delta"])).all()
    worse = alone["difference"] > 0
    assert (alone["p_worse"] < alone["p_better"])[worse].all()
    assert (alone["p_worse"] > alone["p_better"])[~worse].all()


def test_notes_say_what_the_interval_means():
    rng = np.random.default_rng(39)
    a, b = (error_table(normal(rng), repeats=6) for _ in range(2))
    assert "Each side is one session" in compare_errors(a, b, resamples=2).notes[0]
    assert "in the same campaign" in compare_errors(a, b, same_campaign=True, resamples=2).notes[0]
    a["session"] = [f"s{repeat % 2}" for repeat in a["repeat"]]
    a.loc[a["repeat"] % 2 == 1, "delta_s_mm"] += 1000.0
    note = compare_errors(a, b, resamples=2).notes[0]
    assert "Medians of sessions of one and the same side have a standard deviation of" in note
    assert ", 70" in note


def test_what_only_one_side_has_is_left_out_and_said():
    rng = np.random.default_rng(40)
    a = error_table(normal(rng), repeats=6, trajectories=("1_forward", "2_backward"), conditions=("calibrated",))
    b = error_table(normal(rng), repeats=6, trajectories=("1_forward", "5_forward_left"), conditions=("calibrated",))
    comparison = compare_errors(a, b)
    assert comparison.left_out == ("2_backward calibrated: only in A", "5_forward_left calibrated: only in B")
    assert {d.trajectory for d in comparison.differences} == {"1_forward"}


def test_nothing_in_common_is_an_error_and_no_verdict():
    rng = np.random.default_rng(41)
    a = error_table(normal(rng), repeats=6, trajectories=("1_forward",), conditions=("calibrated",))
    b = error_table(normal(rng), repeats=6, trajectories=("1_forward",), conditions=("corrected",))
    with pytest.raises(InputError, match=r"nothing to compare.*A has 1_forward calibrated; B has 1_forward corrected"):
        compare_errors(a, b)
    assert compare_errors(a, b, conditions=("calibrated", "corrected")).differences
    with pytest.raises(InputError, match="--conditions: B has no run under this condition: nominal"):
        compare_errors(a, b, conditions=("calibrated", "nominal"))
    moved = a.assign(target_x_m=2.5)
    with pytest.raises(InputError, match="nothing to compare"):
        compare_errors(a, moved)
    with pytest.raises(InputError, match="B has no run that counts: none of 6 runs with a target is ok"):
        compare_errors(a, a.assign(status="rejected: gap"))


@pytest.mark.parametrize("margin", [-1.0, math.nan, math.inf])
def test_margins_that_cannot_be_used(margin):
    rng = np.random.default_rng(42)
    a = error_table(normal(rng), repeats=3)
    with pytest.raises(FlagError, match="--margin-mm: margin cannot be used"):
        compare_errors(a, a, margin_mm=margin)


def test_json_has_no_number_that_json_lacks():
    rng = np.random.default_rng(43)
    a, b = (error_table(normal(rng), repeats=2) for _ in range(2))
    made = json.loads(json.dumps(comparison_to_json(compare_errors(a, b)), allow_nan=False))
    assert made["schema"] == 1
    assert made["could_compare"] is True
    assert made["differences"][0]["interval"]["low"] is None
    assert {"trajectory", "condition", "verdict", "words", "p_worse"} <= set(made["differences"][0])
    quantities = list(dict.fromkeys(d["quantity"] for d in made["differences"]))
    assert quantities == ["position_mm", "abs_delta_heading_deg", "abs_delta_s_mm"]


def test_the_same_inputs_give_the_same_comparison():
    rng = np.random.default_rng(44)
    a, b = (error_table(heavy_tailed(rng), repeats=7) for _ in range(2))
    assert comparison_to_json(compare_errors(a, b)) == comparison_to_json(compare_errors(a, b))
