"""``agvbench nightly`` as it is called: two simulated nights, one that got worse, and files that name no night."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from agvbench.cli import main
from agvbench.cli.driving.nightly import last_good
from agvbench.errors import FileError
from agvbench.metrics.gate import GateVerdict
from agvbench.workflows.comparison.decision import FailurePolicy, exit_code
from agvbench.workflows.run_next import _copy_what_else

QUICK = ["-k", "trajectory and 1-un", "--repeats", "3", "--exchange", "2"]


def _nightly(lab, *options):
    command = [sys.executable, "-m", "agvbench", "nightly", *QUICK, *options]
    environment = os.environ | {"COLUMNS": "200"}
    return subprocess.run(command, cwd=lab, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def nights(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.toml").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("listed", "tonight", "expected"),
    [("", "one", None), ("one\n", "two", "one"), ("one\ntwo\n", "three", "two"), ("one\ntwo\n", "two", "one")],
)
def test_the_reference_is_the_newest_good_night_before_tonight(nights, listed, tonight, expected):
    (nights / "good_nights.txt").write_text(listed)
    assert last_good(nights, tonight) == (expected and nights / expected)


@pytest.mark.parametrize("name", ["gone", "../elsewhere", "/etc"])
def test_a_name_that_is_no_night_is_refused_before_anything_is_driven(nights, name, capsys):
    (nights / "good_nights.txt").write_text(f"{name}\n")
    with pytest.raises(FileError, match="names no campaign"):
        last_good(nights, "tonight")
    assert main(["nightly", "--nights", str(nights)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert sorted(path.name for path in nights.iterdir()) == ["good_nights.txt", "one", "two"]


def test_a_gate_with_a_mistake_is_refused_before_anything_is_driven(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gate.toml").write_text("schema = 1\n[[rule]]\n")
    assert main(["nightly"]) == 2
    assert "unknown key 'rule'" in capsys.readouterr().err
    assert not (tmp_path / "nightly").exists()


@pytest.mark.slow
def test_a_night_is_judged_by_the_one_before_and_kept_only_where_nothing_failed(tmp_path):
    first = _nightly(tmp_path, "--date", "1")
    assert first.returncode == 0, first.stdout + first.stderr
    assert "the first night: compared with none; the last good night now" in first.stdout
    same = _nightly(tmp_path, "--date", "2", "--seed", "7")
    assert "compared with nightly/1" in same.stdout
    (tmp_path / "gate.toml").write_text('schema = 1\n\n[[rules]]\nfail_on = "position_error.median>1mm"\n')
    worse = _nightly(tmp_path, "--date", "3")
    assert worse.returncode == 1, worse.stdout + worse.stderr
    assert "not a good night; the reference stays" in worse.stdout
    good = (tmp_path / "nightly" / "good_nights.txt").read_text().split()
    assert good == ["1", "2"] if same.returncode == 0 else good == ["1"]
    assert (tmp_path / "nightly" / "3" / "report" / "compare.xml").exists()
    assert "checks failed: position\\_error.median" in (tmp_path / "nightly" / "3" / "report" / "report.md").read_text()


@pytest.mark.parametrize("name", ["a/b", "..", "/etc/x", " "])
def test_a_night_whose_name_is_a_path_is_refused_before_anything_is_driven(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    assert main(["nightly", "--date", name]) == 2
    assert "--date: is no name of a directory" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_margins_are_for_the_comparison_and_not_for_the_bench(tmp_path, monkeypatch):
    given = {}

    def driven(names, options, **more):
        given.update(options)
        return 2

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("agvbench.workflows.bench.run_benchmarks", driven)
    assert main(["nightly", "--margin-mm", "3", "--margin-deg", "2"]) == 2
    assert given["margin_mm"] is given["margin_deg"] is None


@pytest.mark.parametrize(("fail_on", "expected"), [(["regression"], 2), ([], 0)])
def test_a_rule_that_passes_does_not_hide_that_nothing_could_be_compared(tmp_path, fail_on, expected):
    gate = tmp_path / "gate.toml"
    gate.write_text('schema = 1\n\n[[rules]]\nfail_on = "position_error.median>100mm"\n')
    impossible = SimpleNamespace(could_compare=False, of=lambda verdict: [])
    passed = SimpleNamespace(verdict=GateVerdict.PASS)
    assert exit_code(impossible, FailurePolicy.parse(fail_on, gate), [passed]) == expected


def test_a_file_for_results_that_cannot_be_written_is_refused_before_anything_is_driven(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert main(["bench", "--dry-run", "--junitxml", "file/results.xml"]) == 2
    assert "--junitxml file/results.xml: cannot be written" in capsys.readouterr().err


def test_a_plan_of_repeats_refuses_what_it_does_not_use(tmp_path, capsys):
    assert main(["compare", str(tmp_path), "--plan", "--json", str(tmp_path / "c.json")]) == 2
    assert "--json: says nothing with --plan" in capsys.readouterr().err


def test_the_errors_of_the_campaign_before_are_not_those_of_the_next(tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    for folder in (before, after):
        folder.mkdir()
    for name in ("errors.parquet", "provenance.parquet", "bench.toml"):
        (before / name).touch()
    _copy_what_else(before, after)
    assert sorted(path.name for path in after.iterdir()) == ["bench.toml", "provenance.parquet"]
