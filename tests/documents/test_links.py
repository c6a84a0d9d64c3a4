"""Pages that no other page links to are not found."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "how-to").glob("*.md")), ids=lambda page: page.stem)
@pytest.mark.parametrize("start", ["README.md", "docs/index.md"])
def test_every_how_to_is_linked_where_readers_begin(start, page):
    begins = (ROOT / start).parent
    assert f"]({page.relative_to(begins).as_posix()})" in (ROOT / start).read_text(encoding="utf-8").replace("\n", "")
