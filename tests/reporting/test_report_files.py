"""The files of a report: complete, offline, equal to the numbers they come from."""

import csv
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from report_samples import HOSTILE, make_campaign

from agvbench.errors import FileError
from agvbench.reporting.content import Column, plain
from agvbench.reporting.sections.diagnosis import DiagnosisSection
from agvbench.reporting.sections.provenance import ProvenanceSection
from agvbench.reporting.table_files import frame_to_csv
from agvbench.reporting.write import write_report
from agvbench.statistics.rest_poses import start_pose

VOID = {"meta", "link", "br", "img", "hr", "input", "path", "use", "rect"}


class Page(HTMLParser):
    """Collects tags, links and text, and whether every tag that is opened is closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.open, self.ids, self.text = [], [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for name, value in attrs if name in {"src", "href", "xlink:href", "srcset", "action"}]
        self.ids += [value for name, value in attrs if name == "id"]
        assert not [name for name, _ in attrs if name.startswith("on")]
        if tag not in {"meta"}:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def report(campaigns, tmp_path_factory):
    return write_report(campaigns("eight trajectories"), tmp_path_factory.mktemp("out"))


def read(report, name):
    return next(path for path in report.files if path.name == name).read_text(encoding="utf-8")


def test_all_files_are_there(report):
    names = {path.name for path in report.files}
    assert {"report.html", "report.md", "campaign.rrd", "pose_errors.csv", "end_poses.csv", "end_poses.tex"} <= names
    assert all(path.stat().st_size > 100 for path in report.files)


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(report):
    text = read(report, "report.html")
    page = Page(text)
    assert not {"link", "iframe", "img", "object", "embed"} & set(page.tags)
    assert page.tags.count("script") == 1
    assert not re.search(r"<script[^>]*src", text)
    inside = {link for link in page.links if link.startswith("#")}
    linked = {(report.files[0].parent / unquote(link)).resolve() for link in set(page.links) - inside}
    assert linked == {path.resolve() for path in report.data.recordings.values()}
    assert not re.search(r"@import|url\((?!#)|https?://(?!www\.w3\.org)", text)
    clouds, sketches = 8, 8
    assert page.tags.count("svg") == 8 + 3 + 1 + 8 + 3 + clouds + sketches
    targets = {link[1:] for link in inside}
    assert targets <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))


def test_the_page_says_what_calibration_bought(report):
    said = " ".join("".join(Page(read(report, "report.html")).text).split())
    assert re.search(r"Calibration changed the median end position error from [\d.]+ to [\d.]+ mm \(better\)", said)
    assert re.search(r"the median heading error .* deg \(better\) and the median \|Δs\| from", said)
    assert "thesis, tables 8.3–8.10" in said
    assert "rejected: gap of 0.40 s without pose" in said
    assert "sim 1.0" in said


def test_light_dark_and_print_are_provided_for(report):
    text = read(report, "report.html")
    assert "prefers-color-scheme: dark" in text
    assert "@media print" in text
    assert 'name="viewport"' in text
    used = set(re.findall(r"var\(--([a-z0-9]+)\)", text))
    assert used <= set(re.findall(r"--([a-z0-9]+):", text))


def test_the_same_campaign_gives_the_same_bytes(campaigns, report, tmp_path):
    again = write_report(campaigns("eight trajectories"), tmp_path, recording=False)
    for path in again.files:
        assert path.read_text(encoding="utf-8") == read(report, path.name)


def test_tables_hold_the_errors_of_the_runs(report):
    errors = pd.read_csv(next(p for p in report.files if p.name == "pose_errors.csv"))
    table = pd.read_csv(next(p for p in report.files if p.name == "end_poses.csv"))
    rows = table[table.trajectory.str.startswith("6_") & (table.condition == "calibrated")].set_index("reading")
    runs = errors[(errors.trajectory == "6_forward_right") & (errors.condition == "calibrated")]
    for reading, values in (("end position error", runs.position_mm), ("|Δs|", runs.delta_s_mm)):
        row, expected = rows.loc[reading], np.percentile(values.abs(), [0, 25, 50, 75, 100])
        assert list(row[["min", "q1", "median", "q3", "max"]]) == pytest.approx(list(expected))
    # Thesis table 8.8, third number of the second row.
    assert row.published_median == 55.5


def test_figures_draw_every_condition_in_its_own_colour(report):
    text = read(report, "report.html")
    drawings = text[text.index('id="figure-end-pose-figure"') : text.index('id="figure-strips"')]
    assert "var(--c0)" in drawings
    assert "var(--c1)" in drawings
    assert "var(--c2)" not in drawings


def test_spreadsheets_take_no_name_for_a_formula():
    frame = pd.DataFrame(
        {"name": ["=1+1", "@x", "-2", "＝1+1", "⁺1", HOSTILE], "=v": [1.0, math.nan, -3.0, 4.0, 5.0, 6.0]}
    )
    rows = list(csv.reader(frame_to_csv(frame).splitlines()))
    assert rows[0] == ["name", "'=v"]
    assert [row[0][:2] for row in rows[1:]] == ["'=", "'@", "'-", "'＝", "'⁺", "<s"]
    assert [row[1] for row in rows[1:]] == ["1.0", "", "-3.0", "4.0", "5.0", "6.0"]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (-0.004, "0.00"),
        (-1.5, "−1.50"),
        (None, ""),
        (math.nan, ""),
        (math.inf, "∞"),
        (1e-9, "<0.01"),
        (12.345, "12.35"),
    ],
)
def test_numbers_as_people_read_them(value, shown):
    least = 0.01 if value == 1e-9 else -math.inf
    assert Column("x", "x", 2, least=least).shown(value) == shown


def test_plain_text_has_no_control_characters_and_fits_a_line():
    assert "\x1b" not in plain(HOSTILE)
    assert len(plain("x" * 1000)) == 120


@pytest.fixture(scope="module")
def recorded(report):
    """Return the columns of the recording by entity: {path: {time or component: values}}."""
    chunks = pytest.importorskip("rerun.chunk", reason="this Rerun SDK cannot read recordings")
    return _columns(chunks, next(p for p in report.files if p.name == "campaign.rrd"))


def _columns(chunks, path):
    found = {}
    for chunk in chunks.RrdReader(str(path)).stream().to_chunks():
        columns = chunk.to_record_batch().to_pydict()
        found.setdefault(str(chunk.entity_path), {}).update(columns)
    return found


def test_recording_holds_every_run_in_columns(report, recorded):
    counted = int((report.data.errors.status == "ok").sum())
    moving = [len(columns["run_time"]) for entity, columns in recorded.items() if entity.endswith("/vehicle")]
    assert len(moving) == counted
    # 7.2 s at 30 Hz, of which about 1 % were not tracked.
    assert 200 * counted < sum(moving) <= 217 * counted


def test_recording_holds_commands_until_the_next(report, recorded):
    run = next(run for run in report.data.runs if run.is_ok)
    commands = next(columns for entity, columns in recorded.items() if entity.endswith(f"/{run.run_id}/commands"))
    t_s = [at.total_seconds() for at in commands["run_time"]]
    assert t_s[:3] == pytest.approx([0.0, 6.0, 6.0])
    assert t_s[3] == pytest.approx(run.frames.t_s[-1], abs=0.1)
    told = [list(values) for values in commands["Scalars:scalars"]]
    assert told == [[900.0, 1500.0, 1500.0]] * 2 + [[1500.0, 1500.0, 1500.0]] * 2


def test_recording_shows_where_each_run_was_to_go(report, recorded):
    for run in (run for run in report.data.runs if run.is_ok):
        columns = {entity.rpartition("/")[2]: c for entity, c in recorded.items() if f"/{run.run_id}/" in entity}
        target = start_pose(run).pose.compose(run.target)
        assert columns["target"]["Arrows3D:origins"][0][0][:2] == pytest.approx(target[:2], abs=1e-5)
        # Trajectories that ship under these names: the others of this campaign have names of their own.
        assert ("plan" in columns) == (run.trajectory[0] in "5678")
        if "plan" in columns:
            (planned,) = columns["plan"]["LineStrips3D:strips"][0]
            (driven,) = columns["path"]["LineStrips3D:strips"][0]
            assert planned[-1][:2] == pytest.approx(target[:2], abs=1e-4)
            assert planned[0][:2] == pytest.approx(driven[0][:2], abs=0.01)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Return a campaign of so many runs that a process of its own records them."""
    path = tmp_path_factory.mktemp("many") / "campaign"
    return make_campaign(path, repeats=55, trajectories=["5_forward_left"], rate_hz=30.0)


def test_many_runs_are_recorded_by_a_process_of_their_own(many, tmp_path):
    chunks = pytest.importorskip("rerun.chunk", reason="this Rerun SDK cannot read recordings")
    report = write_report(many, tmp_path)
    found = _columns(chunks, tmp_path / "campaign.rrd")
    for run in (run for run in report.data.runs if run.is_ok):
        (moved,) = (columns for entity, columns in found.items() if entity.endswith(f"/{run.run_id}/vehicle"))
        assert moved["run_time"][0].total_seconds() == pytest.approx(run.frames.t_s[0], abs=0.1)
        assert len(moved["run_time"]) > 0.9 * len(run.frames)


def test_a_disk_that_is_full_is_said_of_many_runs_too(many, tmp_path):
    (tmp_path / "campaign.rrd").symlink_to("/dev/full")
    with pytest.raises(FileError, match="No space left") as said:
        write_report(many, tmp_path)
    assert said.value.where == tmp_path / "campaign.rrd"


def test_sections_with_nothing_to_show_are_listed_at_the_end(campaigns, tmp_path):
    written = write_report(campaigns("free driving"), tmp_path, recording=False)
    text = read(written, "report.html")
    said = " ".join("".join(Page(text).text).split())
    assert "Not in this report" in said
    assert "End poses: No run has a target and a measured end pose." in said
    assert text.count("<h2>") == 6


def test_a_missing_diagnosis_is_one_command_away(report_data):
    data = replace(report_data("one condition"), path=Path("to night"))
    (said,) = DiagnosisSection().blocks(data)
    assert "agvbench diagnose 'to night' --json 'to night/diagnosis.json'" in said.text


@pytest.mark.parametrize(
    ("clock", "words"), [("simulated", "1 minutes of simulated time"), ("wall clock", "1 minutes")]
)
def test_how_long_was_driven_says_whose_time_it_is(clock, words, report_data):
    data = report_data("one condition")
    (table,) = ProvenanceSection().blocks(replace(data, provenance={"time": clock}))
    assert dict(table.rows)["runs"] == f"{len(data.runs)}, over {words}"
