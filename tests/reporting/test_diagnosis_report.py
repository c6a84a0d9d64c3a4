from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from report_samples import HOSTILE, make_campaign

from agvbench.cli import main
from agvbench.reporting.content import Bullets, Content, FigureBlock, Paragraph, Table
from agvbench.reporting.pages import to_html
from agvbench.reporting.sections.diagnosis import diagnosis_blocks
from agvbench.workflows.diagnosis_files import JSON, RESIDUALS, ShownDiagnosis, read_diagnosis


def residuals(rows=600, seed=0):
    """Steps whose speed misses 3 % at every place before, and nothing after."""
    rng = np.random.default_rng(seed)
    table = pd.DataFrame(
        {
            "time_in_run_s": rng.uniform(0.0, 8.0, rows),
            "speed_mps": rng.uniform(0.1, 0.32, rows),
            "curvature_per_m": rng.choice([-1.0, 0.0, 1.0], rows),
            "direction": rng.choice([-1.0, 1.0], rows),
            "campaign_time_h": rng.uniform(0.0, 1.0, rows),
            "x_m": rng.uniform(-2.0, 2.0, rows),
            "y_m": rng.uniform(-2.0, 2.0, rows),
            "length_m": np.full(rows, 0.05),
        }
    )
    for feature in ("speed", "sideways", "turning"):
        table[f"before_{feature}"] = 0.03 + 0.001 * rng.normal(size=rows)
        table[f"after_{feature}"] = 0.001 * rng.normal(size=rows)
    return table


def content(name="steering_lag"):
    errors = {"before": 20.0, "after": 2.0, "floor": 1.9, "reproducibility": 2.1}
    return {
        "schema": 1,
        "verdict": "AMBIGUOUS",
        "effects": [
            {
                "name": name,
                "parameters": {"time_constant_s": {"value": 0.2, "stderr": 0.01, "unit": "s"}},
                "confounded_with": ["axle_coupling"],
            }
        ],
        "unexplained": {"significant": True, "depends_on": [{"covariate": "x_m", "share": 0.4, "through": "speed"}]},
        "held_out": {"runs": 24, "position_rms_mm": errors},
        "next_experiment": {"why": "it parts them", "trajectory": {"name": "next_one"}},
        "provenance": {"why": "two would do", "inseparable": [{"between": ["a", "b"], "needs": "a clock"}]},
    }


def test_everything_that_was_found_is_said_and_drawn():
    blocks = diagnosis_blocks(ShownDiagnosis(content(), residuals()))
    lead = next(b for b in blocks if isinstance(b, Paragraph))
    assert lead.text == "AMBIGUOUS: two would do"
    effects, held_out = (b for b in blocks if isinstance(b, Table))
    assert effects.rows == [["steering_lag", "time_constant_s", "0.2 ± 0.01", "s", "axle_coupling"]]
    assert held_out.rows == [["position along the way [mm]", 20.0, 2.0, 1.9, 2.1]]
    sentences = " ".join(next(b for b in blocks if isinstance(b, Bullets)).items)
    for words in ("x_m through speed (40 %", "next_one: it parts them", "a from b; required: a clock"):
        assert words in sentences
    figures = [b for b in blocks if isinstance(b, FigureBlock)]
    assert len(figures) == 3
    for figure in figures:
        assert len(figure.panels) == 7  # time, speed, steering, direction, session; the floor before and after
        for panel in figure.panels:
            ET.fromstring(panel.svg.replace("xlink:href", "href"))  # noqa: S314 - drawn by this package


@pytest.mark.parametrize(
    "broken", [{}, {"schema": 1}, {"schema": 1, "effects": 3, "held_out": [], "provenance": "?"}], ids=repr
)
def test_a_file_that_lacks_things_is_shown_as_far_as_it_goes(broken):
    assert diagnosis_blocks(ShownDiagnosis(broken, None, ("it is odd.",)))


def test_hostile_names_are_escaped():
    blocks = diagnosis_blocks(ShownDiagnosis(content(HOSTILE), residuals(80)))
    page = to_html("t", "s", [Content("diagnosis", "D", tuple(blocks))])
    body = page[page.index("<body>") :]
    assert "<script" not in body
    assert "\x1b" not in body


def test_the_campaigns_report_has_the_section_once_a_diagnosis_lies_there(tmp_path, capsys):
    path = make_campaign(tmp_path / "c", repeats=1, calibration=False)
    assert read_diagnosis(path) is None
    (path / JSON).write_text(json.dumps(content()), encoding="utf-8")
    residuals().to_parquet(path / RESIDUALS)
    assert main(["report", str(path), "--out", str(tmp_path / "r")]) == 0
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert re.search(r'<section id="diagnosis">', page)
    assert "AMBIGUOUS: two would do" in page
    (path / JSON).write_text("{", encoding="utf-8")
    assert "cannot be read" in read_diagnosis(path).problems[0]
    (path / JSON).write_text(json.dumps(content()), encoding="utf-8")
    (path / RESIDUALS).write_bytes(b"PAR1 no more")
    assert read_diagnosis(path).residuals is None


def free_driving(recording="monday.csv"):
    """Errors of a recording held out, of which two of five windows are beyond the training commands."""

    def errors(factor):
        return {
            f"ahead_{seconds}_s": {
                "floor_mm": 2.0,
                "static_mm": {"rms": seconds * factor * 100.0, "low": seconds * factor * 80.0, "high": 250.0 * factor},
                "after_mm": {"rms": seconds * factor * 30.0, "low": float("nan"), "high": float("nan")},
            }
            for seconds in (1, 2)
        }

    parts = {"within": {"windows": 3, **errors(0.5)}, "beyond": {"windows": 2, **errors(2.0)}}
    rows = [
        {"recording": "tuesday.csv", "held_out": False, "windows": 9, **errors(1.0)},
        {"recording": recording, "held_out": True, "windows": 5, **errors(1.0), **parts},
    ]
    ranges = {"drive": {"training": [0.1, 0.4], "test": [-0.2, 0.3]}, "front": {"training": [-1, 1], "test": [-1, 1]}}
    provenance = {**content()["provenance"], "windows": {"recordings": rows, "commands": ranges}}
    return {**content(), "provenance": provenance}


def test_free_driving_has_a_table_and_a_picture_by_recording():
    blocks = diagnosis_blocks(ShownDiagnosis(free_driving(), None))
    table = next(b for b in blocks if isinstance(b, Table) and b.slug == "by_recording")
    assert [column.name for column in table.columns][-2:] == ["static_mm", "after_mm"]
    assert table.rows[:3] == [
        ["monday.csv", "test", 5.0, "1 s", 2.0, 100.0, 30.0],
        ["monday.csv", "test", 5.0, "2 s", 2.0, 200.0, 60.0],
        ["monday.csv", "within", 3.0, "1 s", 2.0, 50.0, 15.0],
    ]
    assert table.rows[-1] == ["tuesday.csv", "training", 9.0, "2 s", 2.0, 200.0, 60.0]
    figure = next(b for b in blocks if isinstance(b, FigureBlock))
    assert [name for name, _ in figure.legend] == ["static maps", "after"]
    for words in ("monday.csv (5)", "within (3)", "beyond (2)"):
        assert words in figure.panels[0].svg
    assert "tuesday" not in figure.panels[0].svg
    sentences = " ".join(next(b for b in blocks if isinstance(b, Bullets)).items)
    assert "2 of 5 test windows have commands beyond" in sentences
    assert "drive -0.2 to 0.3 (training: 0.1 to 0.4)" in sentences
    assert "front" not in sentences


def test_hostile_names_of_recordings_are_escaped():
    blocks = diagnosis_blocks(ShownDiagnosis(free_driving(HOSTILE), None))
    page = to_html("t", "s", [Content("diagnosis", "D", tuple(blocks))])
    body = page[page.index("<body>") :]
    assert "<script" not in body
    assert "\x1b" not in body


@pytest.mark.parametrize("edited", [7, {"recordings": [3, {"held_out": True, "ahead_2_s": 4, "beyond": 1}]}], ids=repr)
def test_edited_errors_by_recording_do_not_stop_the_page(edited):
    shown = {**content(), "provenance": {"windows": edited}}
    assert diagnosis_blocks(ShownDiagnosis(shown, None))


def test_a_long_sentence_is_not_cut():
    why = "structure remains that no effect explains: " + "it depends on campaign_time_h, and " * 5 + "so on"
    shown = ShownDiagnosis({**content(), "verdict": "UNKNOWN", "provenance": {"why": why}}, None, ())
    lead = next(block for block in diagnosis_blocks(shown) if isinstance(block, Paragraph))
    assert lead.text == f"UNKNOWN: {why}"


def test_what_the_lack_of_fit_is_of_is_said():
    runs = {"lack_of_fit_p_value": 0.6712, "lack_of_fit_runs": {"tested": 35, "repeats": 67}}
    blocks = diagnosis_blocks(ShownDiagnosis({**content(), "provenance": runs}, None, ()))
    said = next(block for block in blocks if isinstance(block, Bullets)).items
    among = "against the repeatability in 67 validation and test runs"
    assert f"Lack of fit of the 35 test runs, {among}: p = 0.67." in said


def test_logged_columns_that_were_not_used_are_listed_with_the_reasons():
    left_out = {"odd_V": "constant", **{f"c{k}": "a value in 0 runs, fewer than 20" for k in range(6)}}
    shown = content() | {"provenance": {"logged_columns": {"covariates": ["battery_V"], "left_out": left_out}}}
    (bullets,) = (block for block in diagnosis_blocks(ShownDiagnosis(shown, None)) if isinstance(block, Bullets))
    line = next(item for item in bullets.items if "Logged columns" in item)
    assert line.startswith("Logged columns that were not used: odd_V (constant), c0 (a value in 0 runs")
    assert line.endswith(", and 2 more.")
    used = content() | {"provenance": {"logged_columns": {"covariates": ["battery_V"], "left_out": {}}}}
    assert "Logged columns" not in str(diagnosis_blocks(ShownDiagnosis(used, None)))
