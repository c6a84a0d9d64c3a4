"""Names of trajectories and conditions: text as arguments, even where they are numbers, and those of closed loop."""

from __future__ import annotations

from collections.abc import Collection

from agvbench.errors import InputError
from agvbench.types import Run

CONTROLLER = "controller"
"""Column of the runs table: the controller of a run in closed loop."""


def as_text(value: str, *, where: str) -> str:
    """Return `value`, the name of a trajectory or condition, which is text even where it is a number.

    Raises
    ------
    InputError
        If it is not text.
    """
    if not isinstance(value, str):
        # Types are checked here, because notebooks are not: trajectory=5 looks right.
        raise InputError("must be text", where=where, value=repr(value), remedy=f"write {str(value)!r}")
    return value


def as_texts(values: str | Collection[str], *, where: str) -> set[str]:
    """Return the names in `values`, or `values` as the only one.

    Raises
    ------
    InputError
        If one of them is not text.
    """
    # What is no collection is checked as a name itself, so that its error says what to write.
    several = [values] if isinstance(values, str) or not isinstance(values, Collection) else values
    return {as_text(value, where=where) for value in several}


def controlled_name(trajectory: str, controller: str) -> str:
    """Return what a trajectory is called that a controller drives: open and closed loop are no repeats of each other.

    >>> controlled_name("figure_eight", "PurePursuit")
    'figure_eight-PurePursuit'
    """
    return f"{trajectory}-{controller}"


def planned_name(run: Run) -> str:
    """Return the name of the trajectory that was planned for a run, in open or closed loop."""
    controller = run.extra.get(CONTROLLER)
    return run.trajectory if controller is None else run.trajectory.removesuffix(controlled_name("", str(controller)))
