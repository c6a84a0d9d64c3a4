"""The first screen of a report, what changed since the campaign before, and the uncertainty as files."""

import json
import os
import re
from dataclasses import replace

import pandas as pd
import pytest
import report_samples as samples

from agvbench.campaign.header import CampaignHeader
from agvbench.cli import main
from agvbench.errors import CampaignError, FileError
from agvbench.reporting.content import FigureBlock, Fold, Paragraph, tables_in
from agvbench.reporting.figures.clouds import scale_of
from agvbench.reporting.next_steps import next_steps
from agvbench.reporting.sections.changes import ChangesSection
from agvbench.reporting.sections.headline import HeadlineSection
from agvbench.reporting.sections.runs import RunsSection
from agvbench.reporting.sections.uncertainty import UncertaintySection
from agvbench.reporting.write import write_report
from agvbench.workflows.comparison.kept import read_comparison
from agvbench.workflows.diagnosis_files import ShownDiagnosis
from agvbench.workflows.report import gather
from agvbench.workflows.report_changes import changes_since_before, medians_before_and_now

SMALL = {"repeats": 2, "rate_hz": 30.0, "trajectories": ("6_forward_right",), "calibration": False}


def test_the_first_section_shows_sentence_definition_picture_and_next_step(report_data):
    blocks = HeadlineSection().blocks(report_data("eight trajectories"))
    kinds = [type(block) for block in blocks]
    assert kinds.index(FigureBlock) < 3
    figure = blocks[kinds.index(FigureBlock)]
    assert [panel.title for panel in figure.panels] == list(samples.EIGHT)
    # Five repeats of two conditions, of one at half speed: an ellipse each. One run of trajectory 5 does not count.
    assert [panel.svg.count("<polygon") for panel in figure.panels] == [2, 2, 1, 1, 2, 2, 2, 2]
    said = " ".join(block.text for block in blocks if isinstance(block, Paragraph))
    assert "distance between where a run stopped and where it was to stop" in said
    assert "Next: " in said


def test_the_verdict_of_a_diagnosis_and_its_next_step_stand_on_the_first_screen(report_data):
    content = {"verdict": "NAMED", "provenance": {"why": "steering lag explains the residual"}}
    data = replace(report_data("eight trajectories"), diagnosis=ShownDiagnosis(content, None))
    said = [block.text for block in HeadlineSection().blocks(data) if isinstance(block, Paragraph)]
    assert "Diagnosis: NAMED: steering lag explains the residual" in said
    assert any("bench --corrected" in sentence for sentence in said)


@pytest.mark.parametrize("verdict", ["AMBIGUOUS", "NOT_IDENTIFIABLE", "UNKNOWN"])
def test_the_run_to_drive_next_is_a_next_step(report_data, verdict):
    following = {"trajectory": {"name": "next_lag"}, "why": "distinguishes one lag from another"}
    content = {"verdict": verdict, "next_experiment": following}
    steps = next_steps(replace(report_data("free driving"), diagnosis=ShownDiagnosis(content, None)))
    assert "Next run, next_lag: distinguishes one lag from another." in steps


def test_the_comparison_that_lies_in_the_campaign_and_its_failed_checks_stand_on_the_first_screen(tmp_path):
    night, before = (samples.make_campaign(tmp_path / name, extra_mm=mm) for name, mm in (("b", 60.0), ("a", 0.0)))
    rule = "position_error.median>100mm"
    kept = ["--json", str(night / "comparison.json")]
    assert main(["compare", str(before), str(night), "--fail-on", rule, *kept]) in (0, 1, 3)
    said = [block.text for block in HeadlineSection().blocks(gather(night)) if isinstance(block, Paragraph)]
    (against,) = (sentence for sentence in said if sentence.startswith("Against"))
    assert str(before) in against
    (gate,) = (sentence for sentence in said if sentence.startswith("Gate: "))
    written = json.loads((night / "comparison.json").read_text())["gate"]
    failed = [check for check in written if check["verdict"] == "fail"]
    assert failed
    assert gate.startswith(f"Gate: {len(failed)} of {len(written)} checks failed: {rule} ({failed[0]['trajectory']}")


@pytest.mark.parametrize("content", ["", "{}", '{"a": 1, "headline": "x"}', '{"a": "x", "headline": "x", "gate": [1]}'])
def test_a_comparison_that_cannot_be_read_is_said(tmp_path, content):
    (tmp_path / "comparison.json").write_text(content)
    (line,) = read_comparison(tmp_path)
    assert line.startswith("comparison.json cannot be read: ")


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("one condition", "under a second condition"),
        ("all rejected", "1 of 1 runs do not count"),
        ("eight trajectories", "agvbench diagnose"),
        ("free driving", "agvbench diagnose"),
    ],
)
def test_next_steps_follow_from_the_report(report_data, kind, words):
    assert any(words in step for step in next_steps(report_data(kind)))


def test_all_clouds_have_one_scale_that_holds_them():
    points = samples.np.array([[30.0, -80.0], [1.0, 2.0]])
    ring_mm, half_mm = scale_of([{0: points}, {1: points / 10.0}])
    assert (ring_mm, half_mm) == (50.0, pytest.approx(86.4))


def test_every_run_is_in_a_fold_of_its_trajectory_with_its_recording(report_data):
    data = report_data("eight trajectories")
    folds = [block for block in RunsSection().blocks(data) if isinstance(block, Fold)]
    tables = tables_in(folds)
    assert sorted(row[0] for table in tables for row in table.rows) == sorted(run.run_id for run in data.runs)
    assert all(file.is_file() for table in tables for file in table.files)
    assert all("<svg" in fold.sketch for fold in folds)
    assert any("1 do not count" in fold.summary for fold in folds)


def _dated(path, at, **more):
    made = samples.make_campaign(path, **SMALL, **more)
    (made / "SHA256SUMS").unlink()
    os.utime(made / "campaign.toml", (at, at))
    return made


def test_what_differs_from_the_last_campaign_of_this_vehicle_is_listed(tmp_path):
    monday, tuesday, other = (_dated(tmp_path / name, at) for name, at in (("mon", 1e9), ("tue", 2e9), ("oth", 1.5e9)))
    for path, labels, vehicle in (
        (monday, {"tyres": "old"}, "mule"),
        (tuesday, {"tyres": "new", "floor": "2"}, "mule"),
    ):
        header = replace(CampaignHeader.load(path / "campaign.toml"), labels=labels, vehicle_name=vehicle)
        at = (path / "campaign.toml").stat().st_mtime
        header.save(path / "campaign.toml")
        os.utime(path / "campaign.toml", (at, at))
    pd.DataFrame({"name": ["git_revision"], "value": ["def456"]}).to_parquet(tuesday / "provenance.parquet")
    (tuesday / "SHA256SUMS").unlink()
    changes = changes_since_before(tuesday)
    assert changes.before == monday
    assert changes.driven.year == 2001
    assert {name: (was, now) for name, was, now in changes.differences} == {
        "git_revision": ("abc123", "def456"), "label tyres": ("old", "new"), "label floor": ("", "2"),
    }  # fmt: skip
    assert changes_since_before(monday) is None
    assert changes_since_before(tuesday, other).before == other
    with pytest.raises(CampaignError, match="--against: is no campaign"):
        changes_since_before(tuesday, tmp_path)


def test_nothing_changed_is_said(report_data, tmp_path):
    data = report_data("one condition")
    changes = changes_since_before(data.path, data.path)
    said, medians = ChangesSection().blocks(replace(data, changes=changes))
    assert "No setting, file or label that is recorded differs" in said.text
    assert "end position error" in {row[0] for row in medians.rows}
    assert all(row[-1] == 0.0 for row in medians.rows)


def test_medians_before_and_now_are_of_the_trajectories_that_both_drove():
    columns = ["trajectory", "condition", "metric", "unit", "status", "value"]
    was = [("1", "calibrated", "across_error", "mm", "ok", v) for v in (-10.0, 2.0, 3.0)]
    was += [("2", "calibrated", "across_error", "mm", "ok", 99.0)]
    now = [("1", "calibrated", "across_error", "mm", status, v) for status, v in (("ok", 5.0), ("rejected: gap", 70.0))]
    (row,) = medians_before_and_now(*(pd.DataFrame(rows, columns=columns) for rows in (was, now))).to_dict("records")
    assert row == {
        "metric": "across_error", "unit": "mm", "condition": "calibrated",
        "runs_before": 3, "median_before": 3.0, "runs_now": 1, "median_now": 5.0,
    }  # fmt: skip


def test_uncertainty_is_written_as_json_and_csv(campaigns, tmp_path):
    written = write_report(campaigns("eight trajectories"), tmp_path, recording=False)
    content = json.loads((tmp_path / "tables" / "uncertainty.json").read_text())
    assert content["schema"] == 1
    assert len(content["budgets"]) == len(written.data.budgets) == 2 * (8 + 6)
    table = pd.read_csv(tmp_path / "tables" / "uncertainty.csv")
    first = content["budgets"][0]
    assert first["expanded"] == pytest.approx(first["coverage_factor"] * first["combined"])
    assert list(table.expanded) == pytest.approx([one["expanded"] for one in content["budgets"]])
    every = pd.read_csv(tmp_path / "tables" / "uncertainty_components_all.csv")
    assert len(every) == sum(len(one["components"]) for one in content["budgets"])


def test_what_is_stated_enters_the_budget_from_a_file(campaigns, tmp_path):
    (tmp_path / "lab.toml").write_text(
        "[uncertainty]\ncamera_position_mm = 50\nheading_alignment_deg = {half_width = 1}\n"
    )
    path = campaigns("one condition")
    plain, stated = (
        write_report(path, tmp_path / name, recording=False, uncertainty=file).data.budgets
        for name, file in (("a", None), ("b", tmp_path / "lab.toml"))
    )
    assert stated[0].budget.combined > 10.0 * plain[0].budget.combined
    rows = tables_in(
        UncertaintySection().blocks(replace(write_report(path, tmp_path / "c", recording=False).data, budgets=stated))
    )
    (lacking,) = (table for table in rows if table.slug == "not-stated")
    assert {row[1] for row in lacking.rows} == {
        f"{k} = …" for k in ("camera_scale_ppm", "camera_heading_deg", "marker_offset_mm")
    }


def test_a_statement_in_the_campaign_counts_and_a_wrong_one_is_one_line(tmp_path, capsys):
    path = _dated(tmp_path / "night", 1e9)
    with (path / "campaign.toml").open("a") as file:
        file.write("\n[uncertainty]\ncamera_scale_ppm = 500.0\n[labels]\ncarpet = 2\n")
    data = write_report(path, recording=False).data
    assert data.header.labels == {"carpet": "2"}
    assert any(c.remark == "stated" for c in data.budgets[0].budget.components)
    page = (path / "report" / "report.html").read_text()
    assert "carpet 2" in page
    assert re.search(r'href="\.\./poses\.parquet/r0\.parquet"', page)
    with pytest.raises(FileError, match="lab"):
        write_report(path, uncertainty=tmp_path / "lab.toml")
    (path / "campaign.toml").write_text((path / "campaign.toml").read_text().replace("ppm = 500.0", "ppm = -1.0"))
    assert main(["report", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "campaign.toml: uncertainty: camera_scale_ppm" in line
