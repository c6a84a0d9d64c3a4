"""The supervisor: exchanges in short slices, and a stop, with its error, as soon as a rule complains."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from agvbench.errors import RunStoppedError, SafetyStopError
from agvbench.planning import Workspace
from agvbench.registry import classes_by_file
from agvbench.running.links import RunnerLink
from agvbench.running.supervision import rules
from agvbench.running.supervision.limits import DEFAULT_SAFETY, SafetyLimits
from agvbench.running.supervision.rule import Rule, Slice, WatchWindow
from agvbench.types import Command, Frames


def safety_stop(
    at_s: float, why: str, *, where: str, value: str, limit: str | None = None, ends_session: bool = True
) -> SafetyStopError:
    """Return the error of a vehicle that was stopped `at_s` [s] after its run began, or 0 before that.

    Where the stop does not end the session it is a `RunStoppedError`.
    """
    if not ends_session:
        return RunStoppedError(f"stopped {at_s:.1f} s into the run: {why}", where=where, value=value, limit=limit)
    return SafetyStopError(
        f"stopped {at_s:.1f} s into the run: {why}", where=where, value=value, limit=limit,
        remedy="look at vehicle and camera, then go on with --resume",
    )  # fmt: skip


_SLACK_S = 1e-9


class Supervisor:
    """Watches a run as it is driven.

    A hold is divided into parts of ``control_cycle_s``; every rule checks the frames of each ``watch_s`` of them.
    How a hold is cut makes no difference to what a simulated vehicle does. A vehicle that ``turns_on_the_spot`` is
    moved by its front command, too.
    """

    def __init__(
        self,
        workspace: Workspace,
        neutral: Command,
        limits: SafetyLimits = DEFAULT_SAFETY,
        *,
        turns_on_the_spot: bool = False,
    ) -> None:
        self._workspace, self._neutral, self._limits = workspace, neutral, limits
        self._turns_on_the_spot = turns_on_the_spot
        self._classes = classes_by_file(rules, Rule)  # type: ignore[type-abstract]
        self.begin()

    def begin(self) -> None:
        """Forget the last run."""
        self._rules = [rule(self._limits, self._workspace) for rule in self._classes]
        self._window = WatchWindow()
        self._driving_since_s: float | None = None
        self.commanded_until_s = -math.inf
        """Until when [s] commands of this run were exchanged."""

    def control_cycle(
        self, link: RunnerLink, command: Command, *, t_s: float, hold_s: float, seen: list[Frames]
    ) -> None:
        """Exchange a command as `VehicleLink.control_cycle` does, watching; add the frames of every slice to `seen`.

        Raises
        ------
        SafetyStopError
            If a rule complains; the vehicle was stopped before. It is a `RunStoppedError` if the session may continue.
        LinkError
            As from the link.
        """
        end_s = t_s + hold_s
        turns = self._turns_on_the_spot and command.front != self._neutral.front
        if command.drive == self._neutral.drive and not turns:
            self._driving_since_s = None
        elif self._driving_since_s is None:
            self._driving_since_s = t_s
        for until_s in _parts(t_s, end_s, self._limits.control_cycle_s):
            seen.append(link.control_cycle(command, t_s=t_s, hold_s=until_s - t_s))
            self.commanded_until_s = until_s
            self._look_through(link, seen[-1], t_s, until_s)
            t_s = until_s

    def _look_through(self, link: RunnerLink, frames: Frames, begin_s: float, end_s: float) -> None:
        """Look at what arrived in [begin_s, end_s), one ``watch_s`` after another."""
        ends_s = list(_parts(begin_s, end_s, self._limits.watch_s))
        if len(ends_s) == 1:
            self._look(link, frames, end_s)
            return
        number = np.searchsorted(ends_s[:-1], np.where(np.isfinite(frames.received_s), frames.received_s, frames.t_s))
        for k, until_s in enumerate(ends_s):
            self._look(link, frames.select(number == k), until_s)

    def _look(self, link: RunnerLink, frames: Frames, now_s: float) -> None:
        driving_s = 0.0 if self._driving_since_s is None else now_s - self._driving_since_s
        seen = Slice.of(self._window.with_slice(frames), now_s, driving_s)
        for rule in self._rules:
            if (complaint := rule.complaint(seen)) is not None:
                link.stop()
                what, value, limit = complaint
                raise safety_stop(
                    now_s, what, where=link.keys.root, value=value, limit=limit, ends_session=rule.ends_session
                )


def _parts(begin_s: float, end_s: float, length_s: float) -> Iterator[float]:
    """Yield where the parts of [begin_s, end_s) end that are `length_s` long, the last perhaps shorter [s]."""
    for number in itertools.count(1):
        until_s = begin_s + number * length_s
        if until_s > end_s - _SLACK_S:
            break
        yield until_s
    yield end_s
