"""Campaigns, their directories and runs are arguments wherever they make sense; others are errors with a remedy."""

from __future__ import annotations

import pandas as pd
import pytest

import agvbench
from agvbench.diagnosis import NamedEffect
from agvbench.errors import InputError

BOTH = ("uncalibrated", "calibrated")


@pytest.fixture(scope="module")
def errors(campaign):
    return agvbench.pose_errors(campaign)


def test_errors_are_those_of_a_campaign_its_directory_or_its_runs(campaign, errors):
    for same in (campaign.path, str(campaign.path), list(campaign), iter(campaign)):
        pd.testing.assert_frame_equal(agvbench.pose_errors(same), errors)
    assert len(agvbench.pose_errors(campaign.run("t0"))) == 1
    assert len(agvbench.valid(errors)) == len(errors) == 6


def test_end_poses_and_paths_are_drawn_of_a_campaign_and_of_its_directory(axes, campaign, hostile):
    for source in (campaign, str(campaign.path), campaign.select(trajectory=hostile)):
        assert agvbench.plot.end_poses(axes, source, trajectory=hostile) is axes
    assert agvbench.plot.paths(axes, campaign.run("t0")) is axes
    assert agvbench.plot.paths(axes, str(campaign.path)) is axes


def test_a_directory_is_calibrated_as_its_campaign_is(campaign):
    made, again = agvbench.calibrate(campaign), agvbench.calibrate(str(campaign.path))
    assert made.model.calibration_hash == again.model.calibration_hash


def test_campaigns_directories_runs_and_errors_are_compared_alike(campaign, errors):
    found = [
        agvbench.compare(side, conditions=BOTH, resamples=9).differences
        for side in (campaign, campaign.path, list(campaign), errors)
    ]
    assert found[0]
    assert found == [found[0]] * 4


def test_one_campaign_is_compared_with_itself_by_its_conditions_only(campaign):
    assert "both sides are the same campaign" in agvbench.compare(campaign, str(campaign.path)).notes[-1]
    assert agvbench.compare(campaign, conditions=BOTH).name_b == "calibrated"
    with pytest.raises(InputError, match="one campaign has nothing to be compared with"):
        agvbench.compare(campaign)


CAMPAIGN = r"campaign: is not a campaign: int; give agvbench.Campaign.open\(\"DIRECTORY\"\), or the directory"
RUNS = r"are not runs: {}; give runs from campaign.select, or agvbench.Campaign.open\(\"DIRECTORY\"\), or the directory"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda a, c: agvbench.diagnose(5), CAMPAIGN),
        (lambda a, c: agvbench.calibrate(5), CAMPAIGN),
        (lambda a, c: agvbench.write_report(5), CAMPAIGN),
        (lambda a, c: agvbench.diagnose("nowhere"), "nowhere: does not exist; give a campaign directory"),
        (lambda a, c: agvbench.pose_errors(5), "runs: " + RUNS.format("int")),
        (lambda a, c: agvbench.pose_errors(c.runs), "runs: " + RUNS.format("DataFrame")),
        (lambda a, c: agvbench.compare(c, 5), "b: " + RUNS.format("int")),
        (lambda a, c: agvbench.compare(c.runs, c), "a: is not a table of errors: no column problem; give a campaign"),
        (lambda a, c: agvbench.compare(c, conditions="calibrated"), "conditions: must be two names: 'calibrated'"),
        (lambda a, c: agvbench.compare(c, conditions=(1, 2)), "conditions: must be text: 1; write '1'"),
        (lambda a, c: agvbench.plot.end_poses(a, c, trajectory=5), "trajectory: must be text: 5; write '5'"),
        (lambda a, c: agvbench.plot.end_poses(a, 5, trajectory="5"), "errors: " + RUNS.format("int")),
        (lambda a, c: agvbench.plot.paths(a, 5), "runs: " + RUNS.format("int")),
        (agvbench.plot.comparison, "compared: cannot be drawn: Campaign; give what agvbench.compare"),
        (agvbench.plot.residuals, "diagnosis: cannot be drawn: Campaign; give what agvbench.diagn"),
        (lambda a, c: agvbench.plot.calibration_curve(a, c, "front"), "calibration: cannot be drawn: Campaign; give"),
        (lambda a, c: c.select(trajectory=5), "trajectory: must be text: 5; write '5'"),
        (lambda a, c: c.select(condition=["calibrated", 6]), "condition: must be text: 6; write '6'"),
    ],
)
def test_arguments_of_other_types_are_told_what_to_give(axes, campaign, call, said):
    with pytest.raises(InputError, match=said):
        call(axes, campaign)


def test_what_is_printed_is_one_short_line(campaign):
    many = tuple(NamedEffect(name, {}, (), {}) for name in ("steering_lag", "speed_lag"))
    diagnosis = agvbench.Diagnosis(agvbench.Verdict.NAMED, "it fits", effects=many, provenance={"long": "x" * 9999})
    assert str(diagnosis) == "<Diagnosis NAMED: effects steering_lag, speed_lag; it fits>"
    assert str(campaign).startswith(f"<Campaign {campaign.header.name!r} in {str(campaign.path)!r}: vehicle thesis, ")
    assert str(campaign).endswith("33 runs, 33 of them count>")
    compared = agvbench.compare(campaign, conditions=BOTH)
    assert str(compared).startswith("<Comparison of calibrated with uncalibrated: ")
    assert len(str(compared)) < 240


def test_a_campaign_beside_itself_is_one_campaign(campaign):
    alone, beside = agvbench.compare(campaign, conditions=BOTH), agvbench.compare(campaign, campaign, conditions=BOTH)
    assert beside.differences == alone.differences
    assert beside.notes == alone.notes


def test_a_metric_that_was_not_measured_decides_nothing_and_is_refused(campaign):
    with pytest.raises(InputError, match="--metrics: was not measured on both sides of any trajectory: energy"):
        agvbench.compare(campaign, conditions=BOTH, metrics=["energy"])
