"""Text, TOML and JSON from files, bounded: what people write by hand is short, and nested a few levels deep."""

from __future__ import annotations

import json
import re
import stat
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agvbench.errors import FileError

MAX_BYTES = 4 << 20
MAX_DEPTH = 100
"""How deep tables may be nested: parsers call themselves at each level, and Python allows a thousand calls."""
_PART = r"""(?:[\w-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+')"""
_DOTTED = re.compile(rf"(?<![\w-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}")
"""A key of more parts than tables may be deep: the parser takes memory as the square of their number."""


def require_regular(path: Path) -> None:
    """Refuse what can be read without end, or waits for a writer: pipes and devices.

    Raises
    ------
    FileError
        If `path` is one of them.
    OSError
        If there is nothing there.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # opening a directory says so itself
        raise FileError("is a pipe or a device", where=path, limit="a regular file", remedy="give a file on disk")


def read_text(path: Path, *, max_bytes: int = MAX_BYTES) -> str:
    """Return a file's text, UTF-8, that parsers can take without running out of stack.

    Raises
    ------
    FileError
        If it is no regular file, longer than `max_bytes`, or its brackets are nested deeper than `MAX_DEPTH`.
    OSError, UnicodeDecodeError
        If it cannot be read, or is not UTF-8.
    """
    require_regular(path)
    with path.open("rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise FileError("is too long", where=path, limit=f"{max_bytes} bytes", remedy="give the right file")
    text = data.decode("utf-8")
    if _brackets(text) > MAX_DEPTH:
        raise _too_deep(path)
    return text


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file's content, or raise as `read_text` and `tomllib.loads`."""
    text = read_text(path)
    if text.count(".") > MAX_DEPTH and _DOTTED.search(text):  # dotted keys nest without brackets
        raise _too_deep(path)
    content: dict[str, Any] = _parsed(tomllib.loads, text, path)
    level: list[Any] = [content]
    for _ in range(MAX_DEPTH):
        level = [value for one in level for value in (one.values() if isinstance(one, dict) else one)]
        level = [value for value in level if isinstance(value, dict | list)]
        if not level:
            return content
    raise _too_deep(path)


def read_json(path: Path) -> Any:
    """Return a JSON file's content, or raise as `read_text` and `json.loads`."""
    return _parsed(json.loads, read_text(path), path)


def _parsed(parse: Callable[[str], Any], text: str, path: Path) -> Any:
    """Return the content of `text`; the one error of parsers that does not name a line is that of `int`."""
    try:
        return parse(text)
    except (tomllib.TOMLDecodeError, json.JSONDecodeError):
        raise
    except ValueError:
        limit = f"{sys.get_int_max_str_digits()} digits"
        raise FileError("has an integer that is too long", where=path, limit=limit, remedy="correct it") from None


def _brackets(text: str) -> int:
    """Return how deep brackets are nested, counting those in strings, too: a bound is all that is wanted."""
    if text.count("[") + text.count("{") <= MAX_DEPTH:
        return 0
    depth = deepest = 0
    for character in text:
        if character in "[{":
            depth += 1
            deepest = max(deepest, depth)
        elif character in "]}":
            depth = max(0, depth - 1)
    return deepest


def _too_deep(path: Path) -> FileError:
    return FileError("is nested too deep", where=path, limit=f"{MAX_DEPTH} levels", remedy="give the right file")
