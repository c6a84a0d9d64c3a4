"""The history of campaigns on disk: values, order, steps with what changed there, and what cannot be read."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from history_samples import BEGAN, METRICS, write_night, write_nights

import agvbench
from agvbench.campaign import CampaignHeader
from agvbench.errors import FlagError, InputError
from agvbench.reporting.figures.history import draw_history
from agvbench.vehicle.channels import Channels
from agvbench.workflows.history.facts import changed, facts_of
from agvbench.workflows.history.reading import _chosen
from agvbench.workflows.history.result import write_json

SAVED = Path(__file__).parents[2] / "campaign" / "data"


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """Return 40 nights; before night 25 the end position error grows by 6 standard deviations, with a new firmware."""
    return write_nights(tmp_path_factory.mktemp("lab") / "nightly", 40, step_mm=6.0, at=25)


def test_a_step_is_shown_with_its_night_and_the_firmware_that_changed(stepped):
    found = agvbench.history(stepped)
    (step,) = found.changes.to_dict("records")
    assert (step["metric"], step["condition"], step["unit"]) == ("position_error", "calibrated", "mm")
    assert step["campaign"] == "night-25"
    assert step["driven"] == BEGAN + timedelta(days=25)
    assert step["earliest_night"] <= 25 <= step["latest_night"]
    assert step["change"] == pytest.approx(6.0, abs=1.0)
    assert ("night-25", "firmware 2.0 → 2.1") in step["facts"]
    assert found.headline == "1 step in 3 series of 40 nights."
    assert "night-25" not in found._repr_html_()
    assert "firmware 2.0 → 2.1" in found._repr_html_()


def test_other_command_channels_are_said_in_words(tmp_path):
    facts = []
    for neutral in (1500.0, 1490.0):
        head = CampaignHeader(1, "night", "mule", 0.11, 0.09, Channels.alike("us", neutral), 120.0)
        write_night(tmp_path / f"{neutral:g}", {("position_error", "1"): [1.0]}, header=head)
        facts.append(facts_of(tmp_path / f"{neutral:g}", ""))
    assert list(changed(*facts)) == ["channels us, neutral 1500 → us, neutral 1490"]


def test_equal_nights_of_one_seed_step_with_the_program(tmp_path):
    for night in range(14):
        values = {("position_error", "1"): [15.0 if night >= 8 else 10.0] * 3}
        write_night(tmp_path / f"{night:02d}", values, began=BEGAN + timedelta(days=night))
    (step,) = agvbench.history(tmp_path).changes.to_dict("records")
    assert (step["night"], step["change"], step["sd"]) == (8, 5.0, 0.0)


def test_nightly_values_are_means_of_medians_of_absolute_values(tmp_path):
    values = {("position_error", "1"): [1.0, -5.0, 3.0], ("position_error", "2"): [-10.0, 12.0, 40.0]}
    write_night(tmp_path / "a", values)
    table = agvbench.history(tmp_path).nights.set_index("trajectory")
    assert table.loc["1", "value"] == 3.0
    assert table.loc["2", "value"] == 12.0
    assert table.loc["", "value"] == pytest.approx(7.5)
    assert table.loc["1", "repeatability"] == pytest.approx(1.4826 * 2.0)
    assert list(table["repeats"]) == [6, 3, 3]


def _whole(found):
    return replace(found, nights=found.nights.assign(lacking=0))


def test_a_trajectory_that_some_nights_lack_makes_no_step(tmp_path):
    rng = np.random.default_rng(1)
    for night in range(30):
        error = 10.0 + 0.1 * rng.normal()
        values = {("position_error", "easy"): [error] * 3}
        if night < 15:
            values["position_error", "hard"] = [error + 50.0] * 3
        write_night(tmp_path / f"{night:02d}", values, began=BEGAN + timedelta(days=night))
    found = agvbench.history(tmp_path)
    assert found.changes.empty
    assert found.series["sd"].iloc[0] < 0.2
    over_all = found.nights[found.nights["trajectory"] == ""].set_index("night")
    assert list(over_all["lacking"]) == [0] * 15 + [1] * 15
    ringed, plain = (draw_history(h, "position_error", "mm", {"calibrated": 0}) for h in (found, _whole(found)))
    assert ringed.count("<use") == plain.count("<use") + 15


def test_campaigns_are_ordered_by_provenance_then_by_name_then_by_file(tmp_path):
    value = {("position_error", "1"): [1.0]}
    write_night(tmp_path / "x" / "z-2020-01-01", value, began=datetime(2026, 5, 3, tzinfo=UTC))
    write_night(tmp_path / "y" / "bench-20260501", value)
    old = write_night(tmp_path / "plain", value)
    at = datetime(2026, 5, 2, 12, tzinfo=UTC).timestamp()
    os.utime(old / "campaign.toml", (at, at))
    found = agvbench.history(tmp_path).campaigns
    assert list(found["campaign"]) == ["y/bench-20260501", "plain", "x/z-2020-01-01"]
    assert list(found["dated_by"]) == ["name", "file", "provenance"]


def test_links_are_not_followed_and_nothing_is_looked_for_inside_a_campaign(tmp_path):
    outer = write_night(tmp_path / "lab" / "a", {("position_error", "1"): [1.0]})
    shutil.copytree(outer, outer / "copy")
    write_night(tmp_path / "elsewhere", {("position_error", "1"): [2.0]})
    (tmp_path / "lab" / "link").symlink_to(tmp_path / "elsewhere")
    assert list(agvbench.history(tmp_path / "lab").campaigns["campaign"]) == ["a"]


def _of_another_schema(path):
    text = (path / "campaign.toml").read_text().replace("schema = 1", "schema = 9")
    (path / "campaign.toml").write_text(text)


def _cut_off(path):
    (path / "SHA256SUMS").unlink()
    (path / "errors.parquet").write_bytes((path / "errors.parquet").read_bytes()[:-30])


def _without_a_column(path):
    (path / "SHA256SUMS").unlink()
    pd.DataFrame({"metric": ["a"], "value": [1.0]}).to_parquet(path / "errors.parquet")


def _of_another_type(path):
    (path / "SHA256SUMS").unlink()
    pd.read_parquet(path / "errors.parquet").assign(value="many").to_parquet(path / "errors.parquet")


def _changed(path):
    pd.read_parquet(path / "errors.parquet").assign(value=0.0).to_parquet(path / "errors.parquet")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: (path / "campaign.toml").write_text("schema 1"), "is not TOML"),
        (lambda path: (path / "errors.parquet").unlink(), "bad"),
        (_of_another_schema, "schema 9"),
        (_cut_off, "is cut off"),
        (_without_a_column, "is no table of metrics: no column"),
        (_of_another_type, "has a column of another type"),
        (_changed, "has changed since it was recorded"),
    ],
)
def test_a_campaign_that_cannot_be_read_is_one_line_among_the_others(tmp_path, damage, message):
    write_night(tmp_path / "good", {("position_error", "1"): [1.0]})
    damage(write_night(tmp_path / "bad", {("position_error", "1"): [1.0]}))
    found = agvbench.history(tmp_path)
    assert list(found.campaigns["campaign"]) == ["good"]
    (line,) = found.unread
    assert message in line
    assert str(tmp_path / "bad") in line
    assert "\n" not in line


def test_saved_campaigns_of_every_schema_are_read(tmp_path):
    shutil.copytree(SAVED, tmp_path / "saved")
    found = agvbench.history(tmp_path)
    assert found.unread == ()
    forms = {f"{schema}/{form}" for schema in range(1, 5) for form in ("csv", "parquet", "parts")}
    assert set(found.campaigns["campaign"]) == {f"saved/schema_{name}" for name in forms}


def test_metrics_and_conditions_are_chosen_by_name(stepped):
    found = agvbench.history(stepped, metrics=["own_metric"], conditions="calibrated")
    assert set(found.nights["metric"]) == set(found.series["metric"]) == {"own_metric"}
    with pytest.raises(FlagError, match=r"--metric: no night has it: end_error \(one of: heading_error, own_metric"):
        agvbench.history(stepped, metrics=["end_error"])
    with pytest.raises(FlagError, match=r"--alpha: cannot be used: 0 \(limit: 0.01 to 1\)"):
        agvbench.history(stepped, alpha=0.0)


def test_folders_without_campaigns_are_one_line(tmp_path):
    with pytest.raises(InputError, match="does not exist; give a folder with campaigns"):
        agvbench.history(tmp_path / "nowhere")
    with pytest.raises(InputError, match="has no campaign; give"):
        agvbench.history(tmp_path)
    _of_another_schema(write_night(tmp_path / "bad", {("position_error", "1"): [1.0]}))
    with pytest.raises(InputError, match=r"has no campaign that can be read \(the first: .*schema 9"):
        agvbench.history(tmp_path)


def test_json_has_steps_series_and_campaigns(stepped, tmp_path):
    write_json(agvbench.history(stepped), tmp_path / "h.json")
    made = json.loads((tmp_path / "h.json").read_text(encoding="utf-8"))
    assert made["schema"] == 1
    assert made["changes"][0]["facts"][0].keys() == {"campaign", "changed"}
    assert datetime.fromisoformat(made["changes"][0]["driven"]) == BEGAN + timedelta(days=25)
    assert {series["metric"] for series in made["series"]} == set(METRICS)
    assert len(made["campaigns"]) == 40
    few = agvbench.history(stepped / "night-00").to_json()
    assert few["series"][0]["sd"] is None
    assert few["headline"].startswith("No series has enough nights")


def test_a_metric_and_a_condition_that_no_night_has_together_are_refused():
    nights = SimpleNamespace(series=(("calibrated", "energy", "J"), ("uncalibrated", "position_error", "mm")))
    with pytest.raises(FlagError, match="no night has both: energy and uncalibrated"):
        _chosen(nights, "energy", "uncalibrated")
