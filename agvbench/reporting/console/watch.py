"""``agvbench watch`` on the console: a view that is updated in place, lines of what has changed, or JSON lines."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import msgspec

from agvbench.bus.keys import Keys
from agvbench.bus.messages.runner_state import Phase, RunnerState
from agvbench.reporting.console.state_view import clock, draw_states, ending, print_view, result_text
from agvbench.reporting.content import plain, plain_sentences
from agvbench.workflows.watch import SILENT_S, Watched


def show_states(watched: Watched, *, as_json: bool, once: bool) -> None:
    """Print the states of a runner until there are no more; Ctrl-C ends it quietly."""
    try:
        if as_json:
            _print_json(watched)
        elif once:
            print_view(watched.name, next(watched.states))
        elif sys.stdout.isatty():
            draw_states(watched.name, watched.states, SILENT_S)
        else:
            _print_changes(watched)
    except KeyboardInterrupt:
        if sys.stdout.isatty():
            print()


def state_record(keys: Keys, state: RunnerState) -> dict[str, Any]:
    """Return a state as JSON has it: names of fields are those of the message, numbers of poses and commands too."""
    record = {"lab": keys.lab, "vehicle": keys.vehicle} | msgspec.structs.asdict(state)
    for name in ("pose", "command"):
        if (numbers := record[name]) is not None:
            record[name] = numbers._asdict()
    for name in ("run", "results"):
        record[name] = msgspec.to_builtins(record[name])
    return record


def _print_json(watched: Watched) -> None:
    for state in watched.states:
        if state is not None:
            print(json.dumps(state_record(watched.keys, state)), flush=True)


def _print_changes(watched: Watched) -> None:
    """Print a line for each change, so that the output of a night stays readable."""
    lines = Changes(watched.name)
    for state in watched.states:
        if state is None:
            print(f"no state for {SILENT_S:g} s: the bench or its network hangs", flush=True)
            continue
        for line in lines.of(state):
            print(line, flush=True)


class Changes:
    """The lines that say what is new in a state against the one before."""

    def __init__(self, name: str) -> None:
        self._name, self._before = name, ("", "")
        self._recorded = self._faults = 0
        self._is_first = True

    def of(self, state: RunnerState) -> Iterator[str]:
        """Yield the lines of `state`."""
        at = clock(state.elapsed_s)
        if self._is_first:
            yield f"{at}  watching {plain(state.campaign)} of {self._name}, agvbench {plain(state.version)}"
        yield from (f"{at}  {result_text(result)}" for result in state.results_since(self._recorded))
        yield from (f"{at}  fault: {plain_sentences(line)}" for line in state.faults_since(self._faults))
        self._recorded, self._faults, self._is_first = state.counted + state.rejected, state.fault_count, False
        now = (state.phase.value, state.run.run_id if state.run else "")
        if now != self._before and state.phase is not Phase.FINISHED:
            self._before = now
            yield f"{at}  {_doing(state)}"
        if state.phase is Phase.FINISHED:
            yield f"{at}  {ending(state)}"


def _doing(state: RunnerState) -> str:
    if state.run is None:
        return state.phase.value
    return f"{state.phase.value}: run {state.run.number} of {state.run.of}, {plain(state.run.run_id)}"
