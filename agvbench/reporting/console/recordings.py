"""Imported recordings on the console: what became of their rows."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agvbench.campaign import Campaign
from agvbench.campaign.recordings.importer import IMPORT_TABLE

_COLUMNS = {
    "file": "file",
    "rows": "rows",
    "not_driven": "not driven",
    "not_seen": "not seen",
    "jumped": "jumped",
    "too_short": "too short",
    "used": "used",
    "runs": "runs",
    "seconds": "time s",
}


def print_import(campaign: Campaign, console: Console) -> None:
    """Print the account of every row, and what the campaign holds."""
    console.print(_table(campaign.table(IMPORT_TABLE)))
    sessions = campaign.runs["session"].nunique()
    console.print(f"runs: {len(campaign)}, sessions: {sessions}, campaign: {campaign.path}", soft_wrap=True)


def print_guess(path: str, topics: Iterable[str], questions: Iterable[str], console: Console) -> None:
    """Print the topics of a bag, where the guessed mapping is, and what it leaves to answer."""
    for topic in topics:
        console.print(topic, soft_wrap=True, highlight=False, markup=False)
    console.print(f"wrote {path}", soft_wrap=True, highlight=False)
    for question in questions:
        console.print(f"  ? {question}", soft_wrap=True, highlight=False, markup=False)
    console.print(f"then: agvbench import --mapping {path} FILES --out DIR", soft_wrap=True, highlight=False)


def _table(accounts: pd.DataFrame) -> Table:
    table = Table(
        title="what became of the rows",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1),
        collapse_padding=True,
        show_edge=False,
    )
    for title in _COLUMNS.values():
        table.add_column(title, justify="left" if title == "file" else "right", no_wrap=title == "file")
    for row in accounts.to_dict("records"):
        table.add_row(*(Text(str(row[name])) for name in _COLUMNS))
    if len(accounts) > 1:
        totals = accounts[list(_COLUMNS)[1:]].sum()
        table.add_section()
        table.add_row("all", *(f"{totals[name]:.10g}" for name in list(_COLUMNS)[1:]))
    return table
