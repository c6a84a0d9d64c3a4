"""One page, opened in a browser: what it said, what it fetched, and what axe finds in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page, Request

WINDOWS: tuple[tuple[int, Literal["light", "dark"]], ...] = ((1400, "light"), (390, "dark"))
"""Widths [px] and colour schemes: a desk and a telephone."""


@dataclass
class OpenedPage:
    """A page, with every error that it caused and every address that it fetched."""

    page: Page
    errors: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)

    def listen(self) -> None:
        """Note what happens from now on."""
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("requestfailed", lambda request: self.errors.append(f"not fetched: {request.url}"))
        self.page.on("request", self._note)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"}:
            self.errors.append(message.text)

    def _note(self, request: Request) -> None:
        self.hosts.add(urlsplit(request.url).hostname or "")

    @property
    def width_px(self) -> int:
        """The width of what the page shows; more than the window's where it must be scrolled sideways."""
        return int(self.page.evaluate("document.documentElement.scrollWidth"))

    def accessibility_findings(self) -> list[str]:
        """Return what axe finds that is serious or critical, with the first element of each rule."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page).response["violations"]
        return [
            f"{rule['id']}: {rule['help']}: {rule['nodes'][0]['html'][:200]}"
            for rule in found
            if rule["impact"] in {"serious", "critical"}
        ]


@contextmanager
def opened(
    browser: Browser, url: str, *, width_px: int = 1400, scheme: Literal["light", "dark"] = "light"
) -> Iterator[OpenedPage]:
    """Open a page in a window of its own."""
    context = browser.new_context(viewport={"width": width_px, "height": 900}, color_scheme=scheme)
    try:
        shown = OpenedPage(context.new_page())
        shown.listen()
        shown.page.goto(url)
        shown.page.wait_for_load_state("networkidle")
        yield shown
    finally:
        context.close()
