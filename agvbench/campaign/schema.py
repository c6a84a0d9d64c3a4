"""The columns of the tables of schema 1."""

from __future__ import annotations

from typing import Literal, NamedTuple

Kind = Literal["text", "number", "count", "flag"]


class Column(NamedTuple):
    """A known column: `number` is a float, `count` an integer, `flag` a truth value."""

    name: str
    kind: Kind
    required: bool = True


def _columns(kind: Kind, names: str, *, required: bool = True) -> tuple[Column, ...]:
    return tuple(Column(name, kind, required) for name in names.split())


RUNS = (
    *_columns("text", "run_id experiment trajectory condition"),
    *_columns("count", "repeat"),
    *_columns("number", "target_x_m target_y_m target_heading_rad started_s"),
    *_columns("text", "status firmware"),
    *_columns("text", "session split", required=False),
)
COMMANDS = (*_columns("text", "run_id"), *_columns("number", "t_s drive front rear"))
POSES = (
    *_columns("text", "run_id"),
    *_columns("number", "t_s x_m y_m heading_rad"),
    *_columns("flag", "tracked"),
    *_columns("count", "frame", required=False),
    *_columns("number", "mean_error_m received_s", required=False),
)
TABLES: dict[str, tuple[Column, ...]] = {"runs": RUNS, "commands": COMMANDS, "poses": POSES}
PLANNED_TABLE = "planned"
SPLITS = ("fit", "validation", "held_out")
