"""A lab's own report sections: found in its folder, drawn as others are, and their mistakes said in one line."""

import sys

import pytest

from agvbench.cli import main
from agvbench.errors import FileError
from agvbench.reporting.sections import OWN_SECTIONS, all_sections
from agvbench.reporting.write import write_report

TYRES = '''"""Tyres: how far each run drove on them."""

from agvbench.reporting.content import Column, Paragraph, Table
from agvbench.reporting.sections import Section


class TyresSection(Section):
    """One table."""

    slug, title, order = "tyres", "Tyres & wear", 62

    def blocks(self, data):
        """Return the table."""
        columns = [Column("run_id", "run"), Column("frames", "frames", 0)]
        return [Paragraph("Worn by <these> runs."),
                Table("tyres", "Frames.", columns, [[run.run_id, len(run.frames)] for run in data.runs])]
'''


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """Yield the folder ``report_sections`` of a lab, which is the current folder; its modules are forgotten after."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "report_sections"
    folder.mkdir()
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == OWN_SECTIONS.imported_as]:
        del sys.modules[name]


def test_a_file_in_the_folder_is_a_section_like_those_that_ship(lab, campaigns, tmp_path):
    (lab / "tyres.py").write_text(TYRES)
    (lab / "notes.py").write_text("raise SystemExit('not a section: it imports nothing of the package')")
    slugs = [section.slug for section in all_sections()]
    assert slugs[slugs.index("tyres") - 1] == "runs"  # of equal order, own ones come after those that ship
    written = write_report(campaigns("one condition"), tmp_path / "out", recording=False)
    page = (tmp_path / "out" / "report.html").read_text()
    assert '<section id="tyres">' in page
    assert "Worn by &lt;these&gt; runs." in page
    assert "tyres.csv" in {path.name for path in written.files}
    lines = (tmp_path / "out" / "tables" / "tyres.csv").read_text().splitlines()
    assert len(lines) == 1 + len(written.data.runs)


def test_nothing_in_a_campaign_directory_is_executed(lab, tmp_path):
    (lab / "tyres.py").write_text(TYRES)
    (tmp_path / "campaign.toml").write_text("")
    assert "tyres" not in {section.slug for section in all_sections()}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TYRES.replace('"tyres", "Tyres', '"runs", "Tyres'), "report_sections/tyres.py: there is a section of this"),
        (TYRES.replace("62", '"late"'), "report_sections/tyres.py: section TyresSection: has no order"),
        (TYRES.replace('slug, title, order = "tyres", "Tyres & wear", 62', "slug = 'My tyres'; title = 'T'; order = 1"),
         "slug 'My tyres' is not made of lower-case letters"),
        (TYRES.replace("def blocks", "def block"), "report_sections/tyres.py: section TyresSection: "),
        (TYRES.replace("(Section)", ""), "report_sections/tyres.py: has no section"),
        (TYRES + "\n1 / 0\n", "report_sections/tyres.py:18: cannot be imported: ZeroDivisionError"),
        ("import agvbench.reporting\ndef", "report_sections/tyres.py:2: cannot be imported"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_section_is_one_line(lab, text, said):
    (lab / "tyres.py").write_text(text)
    with pytest.raises(FileError, match="add-a-report-section") as error:
        all_sections()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "len(run.frames)",
            "run.battery",
            "report_sections/tyres.py:16: section tyres cannot be drawn: AttributeError",
        ),
        ('Paragraph("Worn by <these> runs.")', '"Worn"', "section tyres cannot be drawn: TypeError str is no block"),
        ("[run.run_id, len(run.frames)]", "[run.run_id]", "section tyres cannot be drawn: ValueError"),
    ],
)
def test_a_mistake_in_a_section_is_one_line_and_exit_code_2(lab, campaigns, capsys, old, new, said):
    (lab / "tyres.py").write_text(TYRES.replace(old, new))
    assert main(["report", str(campaigns("one condition")), "--out", "out", "--no-recording"]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("own ")]
    assert len(errors) == 1
    assert said in errors[0]
