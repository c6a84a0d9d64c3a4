"""Progress, with the time left: of steps that can be counted, and of a diagnosis, whose steps cannot."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task, TextColumn
from rich.progress_bar import ProgressBar
from rich.text import Text

PATIENCE_S = 2.0
T = TypeVar("T")


def track(items: Iterable[T], total: int, *, what: str) -> Iterator[T]:
    """Yield `items`; on a terminal, show a bar with the time left on standard error once it has taken two seconds."""
    console = Console(file=sys.stderr)
    with Progress(console=console, transient=True, disable=not console.is_terminal, auto_refresh=False) as progress:
        task = progress.add_task(what, total=total, visible=False)
        began = time.monotonic()
        for item in items:
            yield item
            progress.update(task, advance=1, visible=time.monotonic() - began > PATIENCE_S)
            progress.refresh()


def duration_range_s(runs: int, frames: int) -> tuple[float, float]:
    """Return how long a diagnosis takes at least and at most [s], as measured (docs/reference/performance.md).

    170 runs with 190,000 frames took 4 s where nothing is to be found and 60 s where no effect explains the rest, and
    twice as long on a busy machine. Causes are looked for in at most 240 runs.
    """
    searched = frames * min(1.0, 240.0 / max(runs, 1))
    return 3.0 + 2e-5 * searched, 10.0 + 6e-4 * searched


@contextmanager
def searching(runs: int, frames: int) -> Iterator[Callable[[str], None]]:
    """Show on standard error how long a diagnosis takes and what it is at: a bar on a terminal, else a line each.

    The first line follows when the campaign is read and can be diagnosed.
    """
    console = Console(file=sys.stderr, highlight=False, markup=False, soft_wrap=True)
    low_s, high_s = duration_range_s(runs, frames)
    expected = f"{runs} runs, about {frames} frames: takes {_clock(low_s)} to {_clock(high_s)} (min:s)"
    if not console.is_terminal:
        began_s = time.monotonic()
        first = iter([expected])

        def print_line(line: str) -> None:
            gone_s = time.monotonic() - began_s
            for text in first:
                console.print(text)
            console.print(f"{_clock(gone_s)}  {line}; {_left(low_s, high_s, gone_s)}")

        yield print_line
        return
    columns = _Bar(), _Left(low_s), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(expected, total=high_s)
        yield lambda line: progress.update(task, description=line)


class _Bar(ProgressColumn):
    """Time that has passed, of the longest that it takes."""

    def render(self, task: Task) -> ProgressBar:
        """Return the bar."""
        total_s = task.total or 0.0
        return ProgressBar(total=total_s, completed=min(task.elapsed or 0.0, total_s), width=24)


class _Left(ProgressColumn):
    """Time that has passed and is left, `low_s` being the shortest that it takes."""

    def __init__(self, low_s: float) -> None:
        self._low_s = low_s
        super().__init__()

    def render(self, task: Task) -> Text:
        """Return the times."""
        gone_s = task.elapsed or 0.0
        return Text(f"{_clock(gone_s)}  {_left(self._low_s, task.total or 0.0, gone_s)}")


def _left(low_s: float, high_s: float, gone_s: float) -> str:
    if gone_s > high_s:
        return "longer than expected"
    return f"{_clock(max(0.0, low_s - gone_s))} to {_clock(high_s - gone_s)} left"


def _clock(seconds: float) -> str:
    """Return minutes and seconds.

    >>> _clock(125.3)
    '2:05'
    """
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
