"""Runs packed for the kernel: checked once, simulated often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agvbench.errors import InputError
from agvbench.model.compiled import compiled
from agvbench.types import Commands, Floats

Integers = NDArray[np.int64]
_CHANNELS = ("drive", "front", "rear")


@dataclass(frozen=True)
class RolloutBatch:
    """Commands, times and initial poses of many runs, one after another.

    ``command_t_s``, ``drive``, ``front``, ``rear`` have shape (commands,), ``t_s`` has shape (times,); those of run i
    are at ``command_starts[i] : command_starts[i + 1]`` and ``starts[i] : starts[i + 1]``. ``initial`` is (runs, 3).
    """

    command_t_s: Floats
    drive: Floats
    front: Floats
    rear: Floats
    command_starts: Integers
    t_s: Floats
    starts: Integers
    initial: Floats

    @classmethod
    def pack(cls, commands: Sequence[Commands], initial: ArrayLike, t_s: Sequence[ArrayLike]) -> Self:
        """Check and pack runs; see `agvbench.model.rollout.rollout` for what is asked of them.

        Raises
        ------
        InputError
            Naming the run and what is wrong with it.
        """
        times = [np.asarray(t, dtype=np.float64) for t in t_s]
        poses = np.array(initial, dtype=np.float64)
        _check_counts(commands, poses, times)
        command_t_s, command_starts = _concatenate([c.t_s for c in commands], "commands.t_s")
        channels = {name: _concatenate([getattr(c, name) for c in commands], f"commands.{name}") for name in _CHANNELS}
        for name, (_, channel_starts) in channels.items():
            _check_lengths(channel_starts, command_starts, name)
        packed, starts = _concatenate(times, "t_s")
        _check_ascends(command_t_s, command_starts, "commands.t_s", strictly=True)
        _check_ascends(packed, starts, "t_s", strictly=False)
        return cls(
            command_t_s=command_t_s,
            **{name: channel for name, (channel, _) in channels.items()},
            command_starts=command_starts,
            t_s=packed,
            starts=starts,
            initial=poses,
        )

    def split(self, out: Floats) -> list[Floats]:
        """Return the columns of `out` (3, times) by run, each as a view of shape (n, 3)."""
        bounds = self.starts.tolist()
        return [out[:, a:b].T for a, b in pairwise(bounds)]


def _check_counts(commands: Sequence[Commands], initial: Floats, times: list[Floats]) -> None:
    if initial.ndim != 2 or initial.shape[1] != 3:
        raise InputError("initial poses must have shape (runs, 3)", value=initial.shape)
    if not len(commands) == len(initial) == len(times):
        counts = f"{len(commands)}, {len(initial)} and {len(times)}"
        raise InputError("commands, initial poses and times must be equally many", value=counts)
    bad = np.flatnonzero(~np.isfinite(initial).all(axis=1))
    if bad.size:
        raise InputError("initial pose is not finite", where=f"run {bad[0]}", value=initial[bad[0]])
    for i, command in enumerate(commands):
        if len(command) == 0:
            raise InputError("a run needs a command", where=f"run {i}", remedy="give at least one row")


def _concatenate(arrays: Sequence[Floats], what: str) -> tuple[Floats, Integers]:
    starts = np.zeros(len(arrays) + 1, dtype=np.int64)
    for i, array in enumerate(arrays):
        if np.ndim(array) != 1:
            raise InputError("must have one dimension", where=f"run {i}: {what}", value=np.shape(array))
        starts[i + 1] = len(array)
    starts = np.cumsum(starts)
    values = np.concatenate(arrays, dtype=np.float64) if arrays else np.empty(0)
    bad = _first_not_finite(values)
    if bad >= 0:
        raise InputError("is not finite", where=_place(starts, bad, what), value=values[bad])
    return values, starts


def _check_lengths(starts: Integers, command_starts: Integers, name: str) -> None:
    wrong = np.flatnonzero(starts != command_starts)
    if wrong.size:
        run = int(wrong[0]) - 1
        value, limit = starts[run + 1] - starts[run], command_starts[run + 1] - command_starts[run]
        raise InputError("has another length than t_s", where=f"run {run}: commands.{name}", value=value, limit=limit)


def _check_ascends(values: Floats, starts: Integers, what: str, *, strictly: bool) -> None:
    bad = _first_descent(values, starts, strictly)
    if bad >= 0:
        value = f"{values[bad]:.6g} s after {values[bad - 1]:.6g} s"
        raise InputError("time goes back", where=_place(starts, bad, what), value=value, remedy="sort by time")


def _place(starts: Integers, index: int, what: str) -> str:
    run = int(np.searchsorted(starts, index, side="right")) - 1
    return f"run {run}: {what}[{index - starts[run]}]"


@compiled()
def _first_not_finite(values: Floats) -> int:
    for i in range(values.size):
        if not np.isfinite(values[i]):
            return i
    return -1


@compiled()
def _first_descent(values: Floats, starts: Integers, strictly: bool) -> int:
    for run in range(starts.size - 1):
        for i in range(starts[run] + 1, starts[run + 1]):
            if values[i] < values[i - 1] or (strictly and values[i] == values[i - 1]):
                return i
    return -1
