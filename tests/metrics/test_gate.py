"""Gates: what rules mean, what they find, and how seldom they fail where nothing has changed."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from agvbench.errors import AgvbenchError, FileError, FlagError, InputError
from agvbench.metrics.gate import GateVerdict, check_gate
from agvbench.metrics.gate_rules import GateRule, read_gate
from agvbench.model import example_path
from agvbench.reporting.gate_files import gate_table

_UNITS = {"position_error": "mm", "across_error": "mm", "heading_error": "deg", "driving_time": "s"}


def _table(values, *, metric="position_error", status="ok", condition="calibrated"):
    """Return a table of metrics from values by trajectory."""
    rows = [
        (f"{trajectory}-{k}", trajectory, condition, status, metric, value, _UNITS[metric])
        for trajectory, column in values.items()
        for k, value in enumerate(column)
    ]
    return pd.DataFrame(rows, columns=["run_id", "trajectory", "condition", "status", "metric", "value", "unit"])


def _noise(seed, n=10, trajectories="12345678", sd=4.0):
    rng = np.random.default_rng(seed)
    return {t: rng.normal(20.0, sd, n) for t in trajectories}


def _verdicts(rule, b, a=None, **options):
    return {c.trajectory: c.verdict for c in check_gate([GateRule.parse(rule)], b, a, **options)}


def test_an_absolute_limit_compares_the_statistic_itself():
    b = _table({"1": [10.0, 11.0, -40.0], "2": [1.0, 2.0, 3.0]})
    assert _verdicts("position_error.max>30mm", b) == {"1": GateVerdict.FAIL, "2": GateVerdict.PASS}
    assert set(_verdicts("position_error.median>11", b).values()) == {GateVerdict.PASS}


@pytest.mark.parametrize("statistic", ["median", "mean", "p95", "max"])
@pytest.mark.parametrize("limit", ["+10%", "+2mm"])
def test_a_growth_beyond_the_limit_fails_and_a_smaller_one_does_not(statistic, limit):
    a = _noise(1)
    b = {t: values + (25.0 if t == "3" else 0.5) for t, values in _noise(2).items()}
    found = _verdicts(f"position_error.{statistic}>{limit}", _table(b), _table(a))
    assert [t for t, verdict in found.items() if verdict is GateVerdict.FAIL] == ["3"]


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_drift_from_one_side_to_the_other_is_seen_by_bias_and_not_by_absolute_statistics(side):
    # Two standard deviations of the repeats, from half of it on one side to half of it on the other.
    rng = np.random.default_rng(5)
    a = {t: rng.normal(-4.0 * side, 4.0, 20) for t in "123"}
    b = {t: -values for t, values in a.items()}
    tables = _table(b, metric="across_error"), _table(a, metric="across_error")
    assert set(_verdicts("across_error.bias>+0mm", *tables).values()) == {GateVerdict.FAIL}
    assert set(_verdicts("across_error.mean>+0mm", *tables).values()) == {GateVerdict.PASS}
    assert set(_verdicts("across_error.bias>+20mm", *tables).values()) == {GateVerdict.PASS}
    assert {check.allowed for check in check_gate([GateRule.parse("across_error.bias>2mm")], tables[0])} == {2.0 * side}


def test_bias_rarely_fails_where_nothing_has_changed():
    failed = 0
    for seed in range(300):
        rng = np.random.default_rng([6, seed])
        a, b = (_table({"1": rng.normal(3.0, 4.0, 10)}, metric="across_error") for _ in range(2))
        failed += _verdicts("across_error.bias>+0mm", b, a, resamples=2000)["1"] is GateVerdict.FAIL
    assert binomtest(failed, 300, 0.01).pvalue > 1e-3


@pytest.mark.parametrize(("drift_sd", "verdict"), [(0.5, GateVerdict.PASS), (-3.5, GateVerdict.FAIL)])
def test_a_limit_may_be_given_in_standard_deviations_of_the_earlier_repeats(drift_sd, verdict):
    rng = np.random.default_rng(8)
    a, b = rng.normal(0.0, 4.0, 20), rng.normal(4.0 * drift_sd, 4.0, 20)
    tables = _table({"3": b}, metric="across_error"), _table({"3": a}, metric="across_error")
    (check,) = check_gate([GateRule.parse("across_error.bias>+1.5sd")], *tables)
    assert check.verdict is verdict
    assert abs(check.allowed - np.mean(a)) == pytest.approx(1.5 * np.std(a, ddof=1))


def test_what_is_beyond_by_chance_passes_and_says_so():
    rng = np.random.default_rng(8)
    a, b = rng.normal(0.0, 4.0, 10), rng.normal(8.0, 4.0, 10)
    tables = _table({"3": b}, metric="across_error"), _table({"3": a}, metric="across_error")
    (check,) = check_gate([GateRule.parse("across_error.bias>+1.5sd")], *tables)
    assert (check.verdict, check.is_beyond) == (GateVerdict.PASS, True)
    assert gate_table([check]).rows[0][-1] == "pass, beyond by chance"


def test_one_earlier_repeat_has_no_standard_deviation():
    tables = _table({"3": np.arange(200.0)}), _table({"3": [1.0]})
    assert _verdicts("position_error.mean>+1sd", *tables) == {"3": GateVerdict.INCONCLUSIVE}


def test_an_absolute_limit_on_bias_holds_on_both_sides():
    b = _table({"1": [-8.0, -6.0], "2": [8.0, 6.0], "3": [-8.0, 8.0]}, metric="across_error")
    fail, passed = GateVerdict.FAIL, GateVerdict.PASS
    assert _verdicts("across_error.bias>5mm", b) == {"1": fail, "2": fail, "3": passed}


def test_a_rule_for_what_was_not_driven_says_what_was():
    rule = replace(GateRule.parse("position_error.median>5mm"), trajectories=("figure_eight",))
    with pytest.raises(InputError, match=r"figure_eight.*1 calibrated"):
        check_gate([rule], _table({"1": [1.0, 2.0]}))


def test_dispersion_that_grows_fails_whatever_its_mean():
    a, b = _noise(3, 20, "12"), _noise(4, 20, "12")
    b["2"] = 60.0 + 8.0 * (b["2"] - 20.0)
    found = _verdicts("position_error.sd>+50%", _table(b), _table(a))
    assert found == {"2": GateVerdict.FAIL, "1": GateVerdict.PASS}


def test_too_few_repeats_are_inconclusive():
    a, b = _noise(1, 3, "1"), {"1": np.array([500.0, 510.0, 520.0])}
    assert _verdicts("position_error.median>+10%", _table(b), _table(a)) == {"1": GateVerdict.INCONCLUSIVE}


def test_false_failures_are_rare_over_all_rules():
    rules = [GateRule.parse(f"position_error.{s}>+0%") for s in ("median", "mean", "p95")]
    campaigns = [_table(_noise(seed, trajectories="1234")) for seed in range(80)]
    pairs = zip(campaigns[::2], campaigns[1::2], strict=True)
    failed = [check_gate(rules, b, a, resamples=1500)[0].verdict is GateVerdict.FAIL for a, b in pairs]
    assert sum(failed) <= 3  # 1 % of 40 pairs: four or more have a chance of 0.1 %


def test_three_standard_deviations_are_found_among_other_checks():
    rules = [GateRule.parse(f"position_error.{s}>+0%") for s in ("median", "p95")]
    found = 0
    for seed in range(10):
        b = {t: values + (12.0 if t == "3" else 0.0) for t, values in _noise(1000 + seed).items()}
        checks = check_gate(rules, _table(b), _table(_noise(seed)), resamples=2000)
        found += any(check.verdict is GateVerdict.FAIL and check.trajectory == "3" for check in checks)
    assert found >= 8


def test_conditions_are_compared_as_named_and_rejected_runs_do_not_count():
    a, b = _noise(1, 10, "1"), {"1": _noise(2, 10, "1")["1"] + 100.0}
    table = pd.concat([_table(a), _table(b, condition="corrected"), _table({"1": [9e9]}, status="rejected: lost")])
    found = check_gate(
        [GateRule.parse("position_error.median>+10%")], table, table, conditions=("calibrated", "corrected")
    )
    assert [(c.condition, c.verdict, c.repeats_b) for c in found] == [("calibrated → corrected", GateVerdict.FAIL, 10)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("position_error.p95", "is no rule of a gate"),
        ("position_error.p95>", "is no rule of a gate"),
        ("position_error.p95>-5mm", "is no rule of a gate"),
        ("position_error.p99>5mm", "unknown statistic"),
        ("speed.p95>5mm", "unknown metric"),
        ("position_error.p95>5cm", "has another unit than its metric"),
        ("position_error.p95>5%", r"a limit in % is a growth: .*write >\+5%"),
        ("position_error.bias>2sd", r"a limit in sd is a growth: .*write >\+2sd"),
        ("position_error.p95>+2sd", r"a limit in sd is on another statistic: .*one of: median, mean, bias"),
    ],
)
def test_what_is_no_rule_is_refused(text, message):
    with pytest.raises(FlagError, match=message):
        GateRule.parse(text)


def test_rules_of_a_file_apply_where_they_say(tmp_path):
    path = tmp_path / "gate.toml"
    path.write_text(
        'schema = 1\n[[rules]]\nfail_on = "position_error.max>15mm"\ntrajectories = ["2"]\n'
        'conditions = ["calibrated"]\n',
        encoding="utf-8",
    )
    rules = read_gate(path)
    b = _table({"1": [100.0], "2": [20.0]})
    assert {c.trajectory: c.verdict for c in check_gate(rules, b)} == {"2": GateVerdict.FAIL}
    with pytest.raises(InputError, match="applies to no trajectory"):
        check_gate(rules, _table({"1": [100.0]}))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema = 1", "rules"),
        ("schema = 1\nrules = []", "rules"),
        ("schema = 1\n[[rules]]\nfail_on = 'x'", r"rules\[0\]\.fail_on: is no rule"),
        ("schema = 1\n[[rules]]\nfail_on = 'position_error.max>1mm'\ntrajectory = '1'", "trajectory"),
        ("schema = 1\n[[rules]", "is not TOML"),
    ],
)
def test_a_gate_file_that_cannot_be_used_is_refused(tmp_path, text, message):
    path = tmp_path / "gate.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(AgvbenchError, match=message):
        read_gate(path)
    with pytest.raises(FileError, match=r"cannot be read|no such file"):
        read_gate(tmp_path / "none.toml")


def test_growth_needs_an_earlier_campaign():
    with pytest.raises(InputError, match="needs an earlier campaign"):
        check_gate([GateRule.parse("position_error.max>+5%")], _table(_noise(1)))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Return the folder of a campaign of trajectory 5, uncalibrated and calibrated, seven repeats each."""
    folder = tmp_path_factory.mktemp("gate")
    calibrated = ("--calibration", str(example_path("thesis")), "--exchange", "2", "--no-report")
    driven = ("trajectories", "--trajectories", "5", "--repeats", "7", "--seed", "3")
    done = _agvbench(folder, "bench", *driven, *calibrated, "--out", "camp")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def _agvbench(folder, *arguments):
    command = [sys.executable, "-m", "agvbench", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def _root(path):
    return ET.parse(path).getroot()  # noqa: S314 - written by this test


def test_compare_fails_by_rules_and_writes_what_ci_reads(campaign):
    pair = ("compare", "camp", "--conditions", "calibrated", "uncalibrated", "--metrics", "cross_track_rms")
    files = ("--junit", "j.xml", "--markdown", "m.md", "--json", "j.json")
    done = _agvbench(campaign, *pair, "--fail-on", "position_error.median>+10%", *files)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Gate: 1 of 1 checks failed" in done.stdout
    suites = {suite.get("name"): suite for suite in _root(campaign / "j.xml")}
    assert suites["gate"].get("failures") == "1"
    names = {p.get("name") for p in suites["gate"].iter("property")}
    assert {"before", "now", "allowed", "unit"} <= names
    assert [text.text for text in suites["gate"].iter("system-out")] == ["fail"]
    assert suites["comparison"].get("failures") == "0"  # rules alone decide
    content = json.loads((campaign / "j.json").read_text(encoding="utf-8"))
    assert content["gate"][0]["verdict"] == "fail"
    assert "cross_track_rms" in {d["quantity"] for d in content["differences"]}
    assert "position\\_error.median" in (campaign / "m.md").read_text(encoding="utf-8")
    assert _agvbench(campaign, *pair, "--fail-on", "position_error.median>9000mm").returncode == 0
    assert _agvbench(campaign, *pair, "--fail-on", "regression", *files[:2]).returncode == 1
    worse = _root(campaign / "j.xml")[0]
    assert int(worse.get("failures")) > 0
    assert _agvbench(campaign, *pair, "--fail-on", "speed.max>3").returncode == 2
