"""The view of a runner's state: a table of what it does now, its last results and faults."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from agvbench.bus.messages.runner_state import Phase, RunnerState, RunProgress, RunResult
from agvbench.reporting.content import plain, plain_sentences
from agvbench.types import RUN_OK

_BAR = 30
_STYLES = {Phase.DRIVING: "green", Phase.FINISHED: "bold", Phase.PAUSING: "yellow"}


def draw_states(name: str, states: Iterator[RunnerState | None], silent_s: float) -> None:
    """Draw every state over the one before, at a terminal, and leave the last one."""
    console = Console()
    with Live(console=console, auto_refresh=False) as live:
        shown: RunnerState | None = None
        for state in states:
            shown = state or shown
            if shown is not None:
                silent = "" if state else f"no state for {silent_s:g} s: the bench or its network hangs"
                live.update(view(name, shown, silent), refresh=True)


def print_view(name: str, state: RunnerState | None) -> None:
    """Print one state."""
    if state is not None:
        Console(width=None if sys.stdout.isatty() else 110).print(view(name, state))


def view(name: str, state: RunnerState, silent: str = "") -> RenderableType:
    """Return the view of the runner of `name` (lab and vehicle); `silent` says for how long it has been silent."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    table.add_row("bench", Text(f"{plain(state.campaign)}, {name}, agvbench {plain(state.version)}", "bold"))
    table.add_row("phase", Text(silent, "bold red") if silent else _phase(state))
    if state.run is not None and state.phase is not Phase.FINISHED:
        _add_run(table, state.run)
    _add_vehicle(table, state)
    runs = f"{state.counted} counted, {state.rejected} rejected"
    table.add_row("runs", Text(runs))
    parts: list[RenderableType] = [table]
    if state.results:
        parts += [Text(), _results(state)]
    if state.faults:
        parts += [Text(), _faults(state)]
    if state.phase is Phase.FINISHED:
        parts += [Text(), Text(ending(state), "bold")]
    return Group(*parts)


def _phase(state: RunnerState) -> Text:
    return Text.assemble(
        (state.phase.value, _STYLES.get(state.phase, "")), f", {clock(state.elapsed_s)} since it began"
    )


def _add_run(table: Table, run: RunProgress) -> None:
    what = [f"trajectory {plain(run.trajectory)}"] if run.trajectory else [plain(run.experiment)]
    attempt = [f"attempt {run.attempt}"] if run.attempt > 1 else []
    facts = [plain(run.run_id), *what, plain(run.condition), f"repeat {run.repeat}", *attempt]
    table.add_row("run", Text(f"{run.number} of {run.of}: {', '.join(facts)}"))
    table.add_row("session", _bar(run.number - 1, run.of))
    table.add_row("in the run", _bar(run.t_s, run.duration_s, f"{run.t_s:.1f} of {run.duration_s:.1f} s"))


def _bar(done: float, of: float, text: str = "") -> RenderableType:
    bar = Table.grid(padding=(0, 2))
    share = min(max(done / of, 0.0), 1.0) if of > 0.0 else 0.0
    bar.add_row(ProgressBar(total=1.0, completed=share, width=_BAR), Text(text or f"{100.0 * share:.0f} %"))
    return bar


def _add_vehicle(table: Table, state: RunnerState) -> None:
    if (pose := state.pose) is not None:
        heading_deg = math.degrees(pose.heading_rad)
        table.add_row("pose", Text(f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {heading_deg:.1f}°"))
    elif state.command is not None:
        table.add_row("pose", Text("not tracked", "red"))
    if (command := state.command) is not None:
        table.add_row("command", Text(", ".join(f"{name} {value:g}" for name, value in command._asdict().items())))


def _results(state: RunnerState) -> Table:
    table = Table("last runs", "end position error", "heading error", box=None, pad_edge=False, header_style="dim")
    for column in table.columns[1:]:
        column.justify = "right"
    for result in state.results:
        if result.status != RUN_OK:
            table.add_row(Text(plain(result.run_id)), Text(plain_sentences(result.status), "yellow"))
        else:
            table.add_row(Text(plain(result.run_id)), *map(Text, _errors(result) or ("no target", "")))
    return table


def _faults(state: RunnerState) -> RenderableType:
    heading = Text(f"faults: {state.fault_count}", "dim")
    return Group(heading, *(Text(plain_sentences(line), "red") for line in state.faults))


def _errors(result: RunResult) -> tuple[str, str] | None:
    if result.position_mm is None or result.heading_deg is None:
        return None
    return f"{result.position_mm:.1f} mm", f"{result.heading_deg:+.2f}°"


def result_text(result: RunResult) -> str:
    """Return a recorded run in one line."""
    errors = _errors(result)
    found = f", end position error {errors[0]}, heading error {errors[1]}" if errors else ""
    return f"{plain(result.run_id)}: {plain_sentences(result.status)}{found}"


def ending(state: RunnerState) -> str:
    """Return in one line how a bench ended."""
    runs = f"{state.counted} runs counted, {state.rejected} rejected"
    if state.failure is None:
        return f"the bench has finished: {runs}"
    return f"the bench was stopped: {plain_sentences(state.failure)}; {runs}"


def clock(seconds: float) -> str:
    """Return hours, minutes and seconds.

    >>> clock(125.3), clock(3725.0)
    ('2:05', '1:02:05')
    """
    hours, minutes = divmod(int(seconds) // 60, 60)
    return f"{hours}:{minutes:02d}:{int(seconds) % 60:02d}" if hours else f"{minutes}:{int(seconds) % 60:02d}"
