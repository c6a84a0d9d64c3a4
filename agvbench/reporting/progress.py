"""A progress bar that only those see who have to wait."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

PATIENCE_S = 2.0
T = TypeVar("T")


def track(items: Iterable[T], total: int, *, what: str) -> Iterator[T]:
    """Yield `items`; on a terminal, show a bar with the time left on standard error once it has taken two seconds."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(file=sys.stderr)
    with Progress(console=console, transient=True, disable=not console.is_terminal, auto_refresh=False) as progress:
        task = progress.add_task(what, total=total, visible=False)
        began = time.monotonic()
        for item in items:
            yield item
            progress.update(task, advance=1, visible=time.monotonic() - began > PATIENCE_S)
            progress.refresh()
