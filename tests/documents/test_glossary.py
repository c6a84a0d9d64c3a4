"""Words that a newcomer meets first are defined, once, in alphabetical order."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| (?P<term>[^|]+) \| (?P<definition>[^|]+) \|[^|]*\|$", re.MULTILINE)
IN_HOUSE = ("cells", "drawn vehicle", "left open", "mended", "believed", "nobody had looked at", "held out", "told")


def rows():
    text = (ROOT / "docs/reference/glossary.md").read_text(encoding="utf-8")
    terms = text.partition("## Rejected words")[0]
    return [match for match in ROW.finditer(terms) if match["term"] != "term" and not match["term"].startswith("-")]


def trust_table():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return text.partition("## How far to trust it")[2].partition("\n## ")[0]


def test_terms_are_in_alphabetical_order_and_defined_once_in_sentences():
    terms = [row["term"] for row in rows()]
    assert len(terms) > 50
    assert terms == sorted(dict.fromkeys(terms), key=str.casefold)
    assert all(re.match(r"[A-Z].*\.$", row["definition"]) for row in rows())


def test_the_trust_table_uses_defined_words_only():
    table = trust_table()
    assert [word for word in IN_HOUSE if word in table] == []
    terms = {row["term"] for row in rows()}
    assert {"blind trial", "bias", "covariate", "Cramér–Rao bound", "effect", "end stop", "dead band"} <= terms


def test_readme_tutorial_and_index_lead_to_the_glossary():
    for page in ("README.md", "docs/tutorial.md", "docs/index.md"):
        assert re.search(r"\]\((docs/)?reference/glossary\.md\)", (ROOT / page).read_text(encoding="utf-8")), page
