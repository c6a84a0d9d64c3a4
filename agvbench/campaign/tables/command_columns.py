"""The columns of the commands table: by role in memory, and in files by the names that the head gives the channels."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.tables.schema import COMMANDS, ColumnSpec
from agvbench.types import Command


def command_columns(header: CampaignHeader) -> tuple[ColumnSpec, ...]:
    """Return the known columns of a campaign's commands table, as files have them."""
    names = header.command_columns
    kept = (column for column in COMMANDS if column.name in names or column.name not in Command._fields)
    return tuple(column._replace(name=names.get(column.name, column.name)) for column in kept)


def by_role(table: pa.Table, header: CampaignHeader) -> pa.Table:
    """Return a commands table with the columns drive, front and rear, from one with the columns of a file.

    A channel that the vehicle does not have is at neutral.
    """
    names = header.command_columns
    if all(role == name for role, name in names.items()):
        return table
    of_name = {name: role for role, name in names.items()}
    kept = [name for name in table.column_names if name not in Command._fields]
    table = table.select(kept).rename_columns([of_name.get(name, name) for name in kept])
    for role in Command._fields:
        if role not in names:
            table = table.append_column(role, pa.array(np.full(len(table), getattr(header.neutral, role))))
    return table
