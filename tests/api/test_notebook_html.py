"""What notebooks show: short tables with the numbers, everything escaped."""

from __future__ import annotations

from html.parser import HTMLParser

import pytest

import agvbench
from agvbench.diagnosis import Dependence, Estimate, HeldOut, NamedEffect
from agvbench.effects import SteeringLag
from agvbench.model import thesis_vehicle
from agvbench.notebook_html import table_html
from agvbench.planning import list_trajectories
from agvbench.statistics import Comparison

_EMPTY = {"br", "hr", "img", "meta", "link", "input"}


class Page(HTMLParser):
    """Reads HTML: whether every element is closed, which there are, and the rows of tables."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open, self.tags, self.rows = [], set(), []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag not in _EMPTY:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in {"td", "th"}:
            self.rows[-1][-1] += data


def shown(result: object) -> Page:
    """Return the page that a notebook makes of `result`."""
    page = Page(result._repr_html_())
    assert page.tags <= {"p", "strong", "table", "caption", "thead", "tbody", "tr", "th", "td"}
    return page


@pytest.fixture
def diagnosis():
    effect = NamedEffect("steering_lag", {"time_constant_s": Estimate(0.2, 0.01, "s")}, ("<b>",), {})
    held = HeldOut(
        8, {"end_position_mm": {"before": 80.0, "after": 6.0, "floor": 5.0, "reproducibility": 5.5}, "along_mm": {}}, ()
    )
    why = "structure <remains>"
    depends = (Dependence("x_m", 0.001, 0.4, "speed"),)
    return agvbench.Diagnosis(agvbench.Verdict.UNKNOWN, why, effects=(effect,), depends_on=depends, held_out=held)


def test_a_campaign_shows_its_runs_by_condition_and_trajectory(campaign, hostile):
    page = shown(campaign)
    assert page.rows[0] == ["experiment", "trajectory", "uncalibrated", "calibrated"]
    assert page.rows[-1] == ["trajectory", hostile, "3", "3"]
    assert ["drive", "", "13", "0"] in page.rows


def test_a_vehicle_shows_its_maps_and_effects():
    page = shown(thesis_vehicle().with_effects(SteeringLag(time_constant_s=0.25)))
    assert [row[0] for row in page.rows] == ["channel", "front", "rear", "drive", "effect", "steering_lag"]
    assert page.rows[-1] == ["steering_lag", "time_constant_s", "0.25", "s"]


@pytest.mark.parametrize("trajectory", list_trajectories(), ids=lambda trajectory: trajectory.name)
def test_every_trajectory_shows_its_segments(trajectory):
    page = shown(trajectory)
    assert len(page.rows) <= 14


def test_a_diagnosis_shows_verdict_effects_and_errors(diagnosis):
    page = shown(diagnosis)
    assert ["steering_lag", "time_constant_s", "0.2", "0.01", "s", "<b>"] in page.rows
    assert ["end_position_mm", "80", "6", "5", "5.5"] in page.rows
    assert ["along_mm", "–", "–", "–", "–"] in page.rows
    assert "UNKNOWN" in diagnosis._repr_html_()
    assert "depends on x_m" in diagnosis._repr_html_()


def test_a_diagnosis_has_its_numbers_as_frames(diagnosis):
    assert diagnosis.effects_frame()["value"].tolist() == [0.2]
    assert diagnosis.errors_frame().set_index("quantity").loc["end_position_mm", "after"] == 6.0
    empty = agvbench.Diagnosis(agvbench.Verdict.NOT_IDENTIFIABLE, "too few runs")
    assert empty.effects_frame().empty
    assert empty.errors_frame().empty
    assert shown(empty).rows == []


def test_a_comparison_shows_medians_and_verdicts(campaign, hostile):
    errors = agvbench.pose_errors(campaign)
    found = agvbench.compare(
        errors, errors, conditions=("uncalibrated", "calibrated"), same_campaign=True, names=("<a>", "b")
    )
    assert isinstance(found, Comparison)
    page = shown(found)
    assert page.rows[0][4:6] == ["<a>", "b"]
    assert {row[0] for row in page.rows[1:]} == {hostile}
    frame = found.differences_frame()
    assert frame["quantity"].tolist() == ["position_mm", "delta_heading_deg", "delta_s_mm"]
    assert (frame["difference"] < 0.0).all()
    assert (frame["low"] <= frame["difference"]).all()


def test_numbers_are_short_and_what_is_not_there_is_a_dash():
    page = Page(table_html("", ["a", "b", "c", "d"], [[1.23456789, 12, None, float("nan")]]))
    assert page.rows[1] == ["1.235", "12", "–", "–"]
    assert table_html("", ["a"], []) == ""
