"""Every section of every report passes these, a new one without being named here."""

import pkgutil
import re
import xml.etree.ElementTree as ET

import pytest
from conftest import MAKERS

from agvbench.reporting import sections
from agvbench.reporting.content import Bullets, FigureBlock, Paragraph, Table
from agvbench.reporting.pages import to_html, to_markdown
from agvbench.reporting.sections import Section, all_sections
from agvbench.reporting.table_files import to_csv, to_latex

SECTIONS = all_sections()


@pytest.fixture(params=SECTIONS, ids=lambda section: section.slug)
def section(request):
    return request.param


@pytest.fixture(scope="module")
def contents(report_data):
    made = {}

    def get(section, kind):
        if (section.slug, kind) not in made:
            made[section.slug, kind] = section.content(report_data(kind))
        return made[section.slug, kind]

    return get


@pytest.fixture(params=MAKERS)
def content(request, section, contents):
    return contents(section, request.param)


def test_slugs_and_places_are_unique():
    assert len({s.slug for s in SECTIONS}) == len({s.order for s in SECTIONS}) == len(SECTIONS)
    assert [s.order for s in SECTIONS] == sorted(s.order for s in SECTIONS)


def test_every_file_of_the_package_is_a_section_and_no_class_elsewhere_is():
    class Elsewhere(Section):
        slug, title, order = "elsewhere", "Elsewhere", 0

        def blocks(self, data):
            return [Paragraph("")]

    files = {module.name for module in pkgutil.iter_modules(sections.__path__)}
    found = [type(section).__module__.rpartition(".")[2] for section in all_sections()]
    assert sorted(found) == sorted(files - {"base"})


def test_section_says_what_it_is(section):
    assert re.fullmatch(r"[a-z][a-z-]*", section.slug)
    assert section.title[0].isupper()
    assert type(section).__doc__


def test_section_always_says_something_and_never_raises(content):
    assert content.blocks
    for block in content.blocks:
        text = block.text if isinstance(block, Paragraph) else getattr(block, "caption", "bullets")
        assert text.strip()


def test_tables_are_rectangular_and_have_rows(content):
    for table in content.tables:
        assert re.fullmatch(r"[a-z0-9_-]+", table.slug)
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.columns)}
        assert len({column.name for column in table.columns}) == len(table.columns)


def test_tables_become_csv_latex_and_markdown_of_as_many_rows(content):
    for table in content.tables:
        assert to_csv(table).count("\n") >= len(table.rows) + 1
        latex = to_latex(table)
        assert latex.count(r" \\") >= len(table.rows) + 1
        bare = re.sub(r"\\.", "", latex)
        assert bare.count("{") == bare.count("}")
        assert bare.count("$") % 2 == 0
        lines = [line for line in to_markdown("t", [content]).splitlines() if line.startswith("| ")]
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines if line}) >= 1


def test_markdown_rows_have_one_cell_per_column(content):
    for table in content.tables:
        alone = to_markdown("t", [type(content)(content.slug, content.title, (table,))])
        rows = [line for line in alone.splitlines() if line.startswith("|")]
        assert len(rows) == len(table.rows) + 2
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {len(table.columns) + 1}


def test_drawings_are_well_formed_and_fetch_nothing(content):
    for block in content.blocks:
        if isinstance(block, FigureBlock):
            assert block.panels
            for panel in block.panels:
                ET.fromstring(panel.svg.replace("xlink:href", "href"))  # noqa: S314 - drawn by this package
                links = re.findall(r'(?:href|src)="([^"]*)"|url\(([^)]*)\)', panel.svg)
                assert all((a or b).startswith("#") for a, b in links)
                assert "#01010" not in panel.svg


def test_the_same_data_give_the_same_section(section, contents, report_data):
    again = section.content(report_data("own conditions"))
    assert to_html("t", "s", [again]) == to_html("t", "s", [contents(section, "own conditions")])


def test_hostile_names_are_shown_and_not_obeyed(section, contents):
    content = contents(section, "hostile names")
    page = to_html("t", "s", [content])
    body = page[page.index("<body>") :]
    assert "<script" not in body
    assert "\x1b" not in body
    assert "\u202e" not in body
    marked = to_markdown("t", [content])
    assert not re.search(r"(?<!\\)<script", marked)
    for block in content.blocks:
        if isinstance(block, Bullets):
            assert all("\x1b" not in item for item in block.items)
        if isinstance(block, Table):
            assert "<script" not in to_latex(block)
            assert "\x1b" not in to_csv(block)
