"""Reports as people see them: no script that fails, nothing fetched, accessible, readable on a telephone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pytest
from opened_page import WINDOWS, opened

from agvbench.cli import main

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PAGES = ("report/report.html", "history/history.html")


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign with its report, and the history of this one night."""
    path = tmp_path_factory.mktemp("nights") / "tonight"
    assert main(["bench", "--trajectories", "4,6", "--repeats", "3", "--seed", "1", "--out", str(path)]) == 0
    assert main(["history", str(path), "--out", str(path / "history")]) == 0
    return path


@pytest.mark.parametrize("name", PAGES)
def test_reports_are_accessible_and_fit_every_window(browser: Browser, campaign: Path, name: str) -> None:
    for width_px, scheme in WINDOWS:
        with opened(browser, (campaign / name).as_uri(), width_px=width_px, scheme=scheme) as shown:
            assert shown.errors == []
            assert shown.hosts == {""}
            assert shown.width_px <= width_px
            assert shown.accessibility_findings() == []


def test_everything_that_is_folded_is_accessible_too(browser: Browser, campaign: Path) -> None:
    for width_px, scheme in WINDOWS:
        with opened(browser, (campaign / PAGES[0]).as_uri(), width_px=width_px, scheme=scheme) as shown:
            shown.page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            assert shown.width_px <= width_px
            assert shown.accessibility_findings() == []
            link = shown.page.locator("#runs td a").first.get_attribute("href")
            assert link is not None
            assert (campaign / "report" / unquote(link)).is_file()


def test_figures_say_what_they_show(browser: Browser, campaign: Path) -> None:
    with opened(browser, (campaign / PAGES[0]).as_uri()) as shown:
        labels = [image.get_attribute("aria-label") for image in shown.page.locator("svg[role=img]").all()]
        assert len(labels) > 4
        assert all(labels)
        assert any("to (1, −1) m" in label for label in labels if label)
