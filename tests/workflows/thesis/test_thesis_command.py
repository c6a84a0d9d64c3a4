"""`agvbench thesis`: files, one-line errors, the same bytes twice."""

import csv
import json
import math
import os
import subprocess
import sys

import pytest

from agvbench.cli import main
from agvbench.cli.analysis import thesis
from agvbench.thesis import section_names, thesis_sections
from agvbench.thesis.errata import errata_section, printed_speed, printed_yaw_rate
from agvbench.thesis.refits.alternative_maps import maps_section
from agvbench.thesis.section import ThesisTable, key_of, show


def test_files(tmp_path, capsys):
    arguments = ["thesis", "--section", "battery", "--section", "prediction"]
    assert main([*arguments, "--json", str(tmp_path / "t.json"), "--out", str(tmp_path / "tables")]) == 0
    assert "8.3–8.10" in capsys.readouterr().out
    document = json.loads((tmp_path / "t.json").read_text(encoding="utf-8"))
    assert document["schema"] == 1
    assert list(document["sections"]) == ["battery", "prediction"]
    rows = document["sections"]["prediction"]["tables"]["prediction_rows"]
    with (tmp_path / "tables" / "prediction_rows.csv").open(encoding="utf-8") as stream:
        written = list(csv.DictReader(stream))
    assert len(rows) == len(written) == 28
    assert [float(w["predicted"]) for w in written] == [r["predicted"] for r in rows]
    assert "Endurance run" in (tmp_path / "tables" / "thesis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--section", "appendix_z"], "--section: unknown section: appendix_z (one of: steering, drive,"),
        (
            ["--section", "battery", "--json", "{file}/t.json"],
            "t.json: cannot be written: File exists; give --json a place",
        ),
        (["--section", "battery", "--out", "{file}"], "cannot be written: File exists; give --out a place"),
    ],
)
def test_bad_input_is_one_line(arguments, says, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["thesis", *(a.format(file=tmp_path / "file") for a in arguments)]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_the_same_bytes_in_another_process(tmp_path):
    texts = []
    for seed in ("1", "2"):
        path = tmp_path / f"{seed}.json"
        command = [sys.executable, "-c", "import sys; from agvbench.cli import main; sys.exit(main(sys.argv[1:]))"]
        arguments = ["thesis", "--section", "prediction", "--section", "turns", "--json", str(path)]
        subprocess.run(
            [*command, *arguments], check=True, capture_output=True, env=os.environ | {"PYTHONHASHSEED": seed}
        )
        texts.append(path.read_bytes())
    assert texts[0] == texts[1]


def test_findings_are_filled_in_and_end():
    for section in thesis_sections():
        assert section.findings
        for finding in section.findings:
            assert "{" not in finding
            assert finding.endswith(".")
            assert "nan" not in finding


def test_sections_come_in_reading_order():
    assert [s.name for s in thesis_sections(["battery", "steering"])] == ["steering", "battery"]
    assert "sections: " + ", ".join(section_names()) in thesis.__doc__


def test_better_maps_beat_the_thesis_forms_on_pulses_they_have_not_seen():
    values = maps_section().values
    for axle in ("front", "rear"):
        assert values[f"{axle}_end_stops_held_out_deg"] < 0.5 * values[f"{axle}_thesis_held_out_deg"]
    assert values["drive_dead_band_held_out_mm_per_s"] < values["drive_thesis_held_out_mm_per_s"]


def test_errata_are_shown_by_numbers():
    assert printed_speed(0.0, 0.0, 0.32) == pytest.approx((0.32 + 0.121) / 2.0)
    crab = math.radians(20.0)
    assert printed_yaw_rate(crab, crab, 0.32) == pytest.approx(0.32 * math.cos(crab) * 2.0 * math.tan(crab) / 0.302)
    rows = errata_section().tables[0].records()
    assert {"eq. 5.6", "eq. 5.8", "eq. 7.3", "table 8.2"} <= {r["where"] for r in rows}
    assert all(any(c.isalnum() for c in str(r["what_shows_it"])) for r in rows)


def test_tables_refuse_ragged_rows_and_show_cells():
    with pytest.raises(ValueError, match="2 cells under 1 columns"):
        ThesisTable("t", "T", ("a",), ((1, 2),))
    assert key_of("radius if − [mm]") != key_of("radius if + [mm]")
    assert show(float("nan")) == "–"
    assert json.dumps(ThesisTable("t", "T", ("a",), ((float("nan"),),)).records()) == '[{"a": null}]'
