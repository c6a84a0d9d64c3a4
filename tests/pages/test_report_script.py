"""The script of a report: tables sort, sections fold, headings explain themselves; without it, everything is there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from opened_page import OpenedPage, opened

from agvbench.reporting.content import Column, Content, Fold, Paragraph, Table
from agvbench.reporting.pages import to_html

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator

COLUMNS = (Column("name", "name"), Column("size", "size", 1, explained="How large it is."), Column("words", "words"))
ROWS = (
    ["b", -1.5, "12.3 mm"],
    ["a10", 20.0, "−4 mm"],
    ["a9", None, "110 mm"],
    ["c", 3.0, "n/a"],
)
GROUPED = (["one", "x", 2.0], ["one", "y", 1.0], ["two", "x", 9.0], ["two", "y", 8.0])


@pytest.fixture(scope="session")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page with a plain table, a grouped one and a folded one."""
    grouped = (Column("group", "group"), Column("name", "name"), Column("size", "size", 1))
    blocks = [Table("plain", "Plain.", COLUMNS, ROWS), Table("grouped", "Grouped.", grouped, GROUPED, grouped=True)]
    folded = Fold("More", [Table("folded", "Folded.", COLUMNS, ROWS)])
    sections = [Content("first", "First", blocks), Content("second", "Second", [Paragraph("Text."), folded])]
    path = tmp_path_factory.mktemp("script") / "page.html"
    path.write_text(to_html("t", "s", sections), encoding="utf-8")
    return path


@pytest.fixture
def shown(browser: Browser, page_file: Path) -> Iterator[OpenedPage]:
    """Yield the page; no message may be on its console at the end."""
    with opened(browser, page_file.as_uri()) as shown:
        yield shown
        assert shown.errors == []
        assert shown.accessibility_findings() == []


def cells(table: Locator, column: int) -> list[str]:
    return [row.locator("td").nth(column).inner_text() for row in table.locator("tbody tr:has(td)").all()]


@pytest.mark.parametrize(
    ("column", "ascending", "descending"),
    [
        (0, ["a9", "a10", "b", "c"], ["c", "b", "a10", "a9"]),
        # Empty cells come last both ways; numbers with units sort by their size, before words.
        (1, ["b", "c", "a10", "a9"], ["a10", "c", "b", "a9"]),
        (2, ["a10", "b", "a9", "c"], ["c", "a9", "b", "a10"]),
    ],
)
def test_a_click_on_a_heading_sorts(
    shown: OpenedPage, column: int, ascending: list[str], descending: list[str]
) -> None:
    table = shown.page.locator("#table-plain")
    head = table.locator("thead th").nth(column)
    orders = {"ascending": ascending, "descending": descending, "none": [str(row[0]) for row in ROWS]}
    for state, names in orders.items():
        head.get_by_role("button").click()
        assert head.get_attribute("aria-sort") == state
        assert cells(table, 0) == names


def test_a_key_sorts_and_one_column_at_a_time_is_sorted(shown: OpenedPage) -> None:
    heads = shown.page.locator("#table-plain thead th")
    heads.nth(0).get_by_role("button").focus()
    shown.page.keyboard.press("Enter")
    shown.page.keyboard.press("Tab")
    shown.page.keyboard.press("Space")
    assert [head.get_attribute("aria-sort") for head in heads.all()] == ["none", "ascending", "none"]


def test_rows_keep_to_their_group(shown: OpenedPage) -> None:
    table = shown.page.locator("#table-grouped")
    table.locator("thead th").nth(1).get_by_role("button").click()
    assert cells(table, 1) == ["1.0", "2.0", "8.0", "9.0"]
    assert [group.inner_text() for group in table.locator("th.heading").all()] == ["one", "two"]
    assert table.locator("tbody").first.locator("tr").first.inner_text() == "one"


def test_sections_fold_and_a_link_unfolds(shown: OpenedPage) -> None:
    section = shown.page.locator("#first")
    button = section.locator("h2").get_by_role("button")
    assert button.get_attribute("aria-expanded") == "true"
    button.click()
    assert button.get_attribute("aria-expanded") == "false"
    assert not section.locator("#table-plain").is_visible()
    shown.page.locator("nav a[href='#first']").click()
    section.locator("#table-plain").wait_for(state="visible")
    assert button.get_attribute("aria-expanded") == "true"


def test_a_heading_explains_itself_to_the_keyboard(shown: OpenedPage) -> None:
    tip = shown.page.locator("#tip")
    assert not tip.is_visible()
    shown.page.locator("#table-plain thead th").nth(1).get_by_role("button").focus()
    assert tip.inner_text() == "How large it is."
    shown.page.keyboard.press("Escape")
    assert not tip.is_visible()


def test_printing_unfolds_everything(shown: OpenedPage) -> None:
    shown.page.locator("#second h2").get_by_role("button").click()
    shown.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert shown.page.locator("#table-folded").is_visible()


def test_without_a_script_everything_is_there_in_its_order(browser: Browser, page_file: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    try:
        page = context.new_page()
        page.goto(page_file.as_uri())
        assert cells(page.locator("#table-plain"), 0) == [str(row[0]) for row in ROWS]
        assert page.locator("button").count() == 0
        assert page.locator("#table-plain thead th").nth(1).get_attribute("title") == "How large it is."
        page.locator("summary").click()
        assert page.locator("#table-folded").is_visible()
    finally:
        context.close()


def test_the_script_is_short(root: Path) -> None:
    lines = (root / "reports" / "templates" / "report.js").read_text(encoding="utf-8").splitlines()
    assert len(lines) < 150
