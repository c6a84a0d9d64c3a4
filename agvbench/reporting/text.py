"""Rich tables as plain text, for terminals that are written to by somebody else (pytest, a log)."""

from __future__ import annotations

import io
import os
import shutil

from rich.console import Console, RenderableType

_NARROWEST = 100


def as_text(renderable: RenderableType) -> str:
    """Return `renderable` as lines without colours: as wide as ``COLUMNS`` says, else as the terminal, at least 100."""
    columns = shutil.get_terminal_size((_NARROWEST, 24)).columns
    width = columns if os.environ.get("COLUMNS", "").isdigit() else max(_NARROWEST, columns)
    console = Console(file=io.StringIO(), width=width, no_color=True)
    console.print(renderable)
    file = console.file
    assert isinstance(file, io.StringIO)  # noqa: S101 - it is the one made above
    return file.getvalue().rstrip("\n")
