"""Report words that the glossary rejects, with the term to use: ``python tools/check_terms.py [ROOT]``.

The table under "Rejected words" of docs/reference/glossary.md declares each word or phrase, what to use instead, and
where it is allowed: paths that begin so, or phrases in which it is meant otherwise. Identifiers are split at
underscores and capitals; of strings, docstrings and comments whole words are read; of pages the prose, without code.
"""

from __future__ import annotations

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

GLOSSARY = "docs/reference/glossary.md"
HEADING = "## Rejected words"
_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_NO_PROSE = re.compile(
    r"^ *(`{3,}|~{3,}).*?^ *\1[^\S\n]*$|``.+?``|`[^`\n]+`|<[^>\n]*>|\]\([^)\n]*\)|https?://\S+", re.M | re.S
)
_INLINE = re.compile(r"``[^`]+``|`[^`\n]+`|https?://\S+")


class Rejected(NamedTuple):
    """A word or phrase, what to use instead, and the paths and phrases where it stays.

    >>> Rejected("helm", "command mapping").hits("at the helm, not Wilhelm")
    [7]
    >>> Rejected("floor", "repeatability", phrases=("floor frame",)).hits("in the floor frame")
    []
    """

    word: str
    instead: str
    paths: tuple[str, ...] = ()
    phrases: tuple[str, ...] = ()

    def hits(self, text: str) -> list[int]:
        """Return where in `text` the word stands, allowed phrases left out."""
        spans = [m.span() for phrase in self.phrases for m in re.finditer(_spaced(phrase), text, re.I)]
        found = [m.start() for m in re.finditer(rf"(?<![\w-]){_spaced(self.word)}(?![\w-])", text, re.I)]
        return [at for at in found if not any(first <= at < last for first, last in spans)]


def _spaced(phrase: str) -> str:
    return r"[\s#]+".join(re.escape(word) for word in phrase.split())


def rejected_words(page: str) -> list[Rejected]:
    """Return the rows of the table under `HEADING`, in whose third column semicolons separate paths and phrases."""
    made = []
    for line in page.partition(HEADING)[2].partition("\n## ")[0].splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) != 3 or cells[0] in {"", "rejected"} or set(cells[0]) <= {"-", ":"}:
            continue
        allowed = [entry.strip().strip("`") for entry in cells[2].split(";") if entry.strip()]
        paths = tuple(entry for entry in allowed if re.search(r"/|\.\w+$", entry))
        phrases = tuple(entry for entry in allowed if entry not in paths)
        made += [Rejected(word.strip(), cells[1], paths, phrases) for word in cells[0].split(",")]
    return made


def _texts_of_code(text: str) -> Iterator[tuple[int, str]]:
    """Yield identifiers, strings and comments with their lines; identifiers as words, strings without inline code."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield token.start[0], " ".join(_PART.findall(token.string))
        elif token.type in {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}:
            yield token.start[0], _INLINE.sub(_blank, token.string)


def _blank(found: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", found.group())


def complaints(root: Path) -> list[str]:
    """Return ``file:line: word: use …`` for every rejected word below `root`."""
    glossary = (root / GLOSSARY).read_text(encoding="utf-8")
    rejected = rejected_words(glossary)
    anything = re.compile("|".join(_spaced(entry.word) for entry in rejected) or "(?!)", re.I)
    has_any = cache(lambda part: anything.search(part) is not None)  # the same identifiers stand everywhere
    found: list[tuple[str, int, str, str]] = []
    pages = [path for path in (root / "README.md", *sorted((root / "docs").rglob("*.md"))) if path.is_file()]
    for path in (*sorted((root / "agvbench").rglob("*.py")), *pages):
        name, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
        if name == GLOSSARY:
            text = text.partition(HEADING)[0]
        parts = _texts_of_code(text) if path.suffix == ".py" else [(1, _NO_PROSE.sub(_blank, text))]
        words = [entry for entry in rejected if not name.startswith(entry.paths)]
        for line, part in parts:
            for entry in words if has_any(part) else ():
                found += ((name, line + part.count("\n", 0, at), *entry[:2]) for at in entry.hits(part))
    return [f"{name}:{line}: {word}: use {instead}" for name, line, word, instead in dict.fromkeys(sorted(found))]


def main(arguments: list[str]) -> int:
    """Print the complaints; return 1 if there are any."""
    found = complaints(Path(arguments[0]) if arguments else Path(__file__).resolve().parents[1])
    print(*found, sep="\n", end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
