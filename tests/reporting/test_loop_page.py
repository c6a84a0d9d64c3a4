"""The page of a loop: end poses before and after, the diagnosis, and links to the reports of both campaigns."""

import re
from types import SimpleNamespace

import report_samples as samples

from agvbench.loop.before_after import EndPosition
from agvbench.loop.loop import Loop
from agvbench.reporting.loop_report import _headline, write_loop_report
from agvbench.running.configuration.settings import BenchSettings

DIAGNOSIS = {"schema": 1, "verdict": "NAMED", "provenance": {"why": "steering lag explains the residual"}}


def test_the_page_holds_picture_diagnosis_and_links(tmp_path):
    small = {"repeats": 4, "rate_hz": 30.0, "trajectories": ("1_forward", "6_forward_right"), "calibration": False}
    loop = Loop(tmp_path, BenchSettings(), DIAGNOSIS, {})
    samples.make_campaign(loop.before, **small)
    samples.make_campaign(loop.after, **small, conditions=("uncalibrated", "calibrated", "corrected"))
    write_loop_report(loop)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    top = page[page.index('<section id="before-after">') : page.index('<section id="diagnosis">')]
    assert top.count("<figure") == 2
    assert top.count("<polygon") == 2 * 3  # an ellipse per trajectory and condition
    assert 'id="figure-clouds"' not in page
    assert "NAMED: steering lag explains the residual" in page
    links = re.findall(r'<li><a href="([^"]*)">', top)
    assert len(links) == 2
    assert all((tmp_path / link).resolve().is_file() for link in links)
    ids = re.findall(r' id="([^"]*)"', page)
    assert len(ids) == len(set(ids))


def test_means_are_over_the_trajectories_that_every_condition_has():
    whole = EndPosition("5", {"uncalibrated": 40.0, "calibrated": 10.0, "corrected": 9.0}, {})
    lacking = EndPosition("own", {"uncalibrated": 400.0, "calibrated": 110.0}, {})
    said = list(_headline(SimpleNamespace(plans={}, diagnosis={}), [], [whole, lacking]))
    means = "uncalibrated 40.0 mm, calibrated 10.0 mm, corrected 9.0 mm"
    assert said[:2] == [
        f"Median end position error, mean over trajectories: {means}.",
        "Not driven under every condition, and in none of these means: own.",
    ]
