"""The columns of the commands table: by role in memory, and in files by the names that the head gives the channels.

Commands of wheels are converted to commands of the body where they are read, and back where they are written.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.tables.schema import COMMANDS, ColumnSpec
from agvbench.types import Command, Commands, Floats
from agvbench.vehicle.wheels import WheelCommand


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
    if (wheels := header.channels.wheels) is not None:
        left, right = (table[role].to_numpy().astype(np.float64) for role in ("drive", "front"))
        for role, values in zip(("drive", "front"), wheels.body(left, right), strict=True):
            table = table.set_column(table.column_names.index(role), role, pa.array(values, from_pandas=False))
    return table


def file_columns(commands: Commands, header: CampaignHeader) -> dict[str, Floats]:
    """Return the columns (n,) of a campaign's commands table in files, by name."""
    if (wheels := header.channels.wheels) is not None:
        return dict(zip(WheelCommand._fields, wheels.wheels(commands.drive, commands.front), strict=True))
    return {name: getattr(commands, role) for role, name in header.command_columns.items()}
