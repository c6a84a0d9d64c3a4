"""The documentation site, built and opened: nothing from other hosts, accessible, fits a telephone, searchable."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from opened_page import WINDOWS, opened

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PAGES = ("index", "tutorial", "how-to/nightly", "reference/metrics", "reference/api", "reference/performance")
LEFT_OUT = {"docs/decisions"}
"""Folders whose pages are reached from their README."""


@pytest.fixture(scope="session")
def built(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of the site, built from a copy; a warning is an error."""
    pytest.importorskip("zensical", reason="the extra [docs] is not installed")
    copy = tmp_path_factory.mktemp("project")
    for name in ("docs", "agvbench"):
        shutil.copytree(root / name, copy / name)
    shutil.copy(root / "zensical.toml", copy)
    build = [sys.executable, "-m", "zensical", "build", "--strict"]
    done = subprocess.run(build, cwd=copy, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return copy / "site"


@pytest.fixture(scope="session")
def site(built: Path) -> Iterator[str]:
    """Yield the address of the site."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(built)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        """Say nothing."""


def test_every_page_is_in_the_navigation(root: Path) -> None:
    with (root / "zensical.toml").open("rb") as file:
        listed = set(_pages(tomllib.load(file)["project"]["nav"]))
    there = {
        path.relative_to(root / "docs").as_posix()
        for path in (root / "docs").rglob("*.md")
        if path.parent.relative_to(root).as_posix() not in LEFT_OUT and "blind-trials/" not in path.as_posix()
    }
    assert listed - {"decisions/README.md"} == there


def _pages(entry: Any) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
    else:
        for part in entry.values() if isinstance(entry, dict) else entry:
            yield from _pages(part)


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_accessible_and_fit_every_window(browser: Browser, site: str, name: str) -> None:
    for width_px, scheme in WINDOWS:
        with opened(browser, f"{site}/{name}.html", width_px=width_px, scheme=scheme) as shown:
            assert shown.errors == []
            assert shown.hosts == {"127.0.0.1"}
            assert shown.width_px <= width_px
            assert shown.accessibility_findings() == []


def test_search_finds_the_cross_track_error(browser: Browser, site: str) -> None:
    with opened(browser, f"{site}/index.html") as shown:
        shown.page.keyboard.press("Control+k")
        shown.page.keyboard.type("cross track")
        result = shown.page.locator("a[href*='reference/metrics.html']").filter(has_text="cross").first
        result.wait_for(state="attached")
        assert shown.errors == []
