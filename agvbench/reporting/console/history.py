"""A history on the console: steps first, then every metric, then what was not read, and the answer last."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from agvbench.reporting.console.tables import console_table
from agvbench.reporting.content import plain_sentences
from agvbench.reporting.history_report import WrittenHistory, changes_table, series_table
from agvbench.workflows.history.result import History

_UNREAD_SHOWN = 10


def print_history(console: Console, history: History, written: WrittenHistory) -> None:
    """Print the steps, every metric, the campaigns that were not read, and the files written."""
    for table in (series_table(history), *([changes_table(history)] if len(history.changes) else [])):
        console.print(console_table(table))
        console.print(Text(table.note, style="dim"))
    for line in _unread(history.unread):
        console.print(Text(f"not read: {plain_sentences(line)}", style="yellow"), soft_wrap=True)
    console.print(Text(history.headline, style="bold"))
    console.print(Text(f"wrote {written.page} and {written.nights}"), soft_wrap=True)


def _unread(lines: Sequence[str]) -> list[str]:
    more = len(lines) - _UNREAD_SHOWN
    return [*lines[:_UNREAD_SHOWN], *([f"{more} more campaigns (see the page)"] if more > 0 else [])]
