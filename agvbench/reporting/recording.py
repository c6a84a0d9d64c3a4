"""A recording for the Rerun viewer: what it shows of a campaign's runs that count, and its faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.errors import FileError
from agvbench.executors import Executor, ExecutorOptions, Failed, Task, open_executor
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.plot.style import colour, condition_numbers
from agvbench.reporting.content import plain
from agvbench.reporting.viewer.recording_file import Recorded, import_rerun, write_recording_file
from agvbench.statistics.end_poses import in_order
from agvbench.workflows.output_files import write_file
from agvbench.workflows.report import reported_events

_FLAG = "--out"
_OWN_PROCESS_RUNS = 100
"""From this number of runs on, a process of its own saves more than its start takes."""


@contextmanager
def recorder(campaign: Campaign, path: Path) -> Iterator[Callable[[Sequence[MeasuredRun]], None]]:
    """Give a function that takes the runs of a campaign; their recording is there when the context ends.

    Under ``/runs/TRAJECTORY/CONDITION/RUN``: ``path``, ``plan`` (lines) and ``target`` (an arrow), always there;
    ``vehicle`` (an arrow that moves on the timeline ``run_time``, 0 at the first command), ``commands`` (each of the
    three, held until the next) and ``residual`` (along the planned path). Poses are thinned to 60 Hz. ``/floor`` is the
    workspace, ``/faults`` what adapters reported. The viewer opens with all runs on one floor, and with a tab for each
    trajectory, in it for each condition, in it for each run where these are few. A process of its own writes many runs.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    if len(campaign) < _OWN_PROCESS_RUNS:
        # Written last: on a disk that is full, Rerun's messages about it may hold up this process.
        given = list[Sequence[MeasuredRun]]()
        yield given.append
        for runs in given:
            write_file(_FLAG, path, partial(write_recording_file, _shown(campaign, runs)))
        return
    with open_executor(ExecutorOptions(jobs=1)) as process, ThreadPoolExecutor(1) as thread:
        begun = [thread.submit(_run, process, Task("imports", import_rerun, ()))]

        def begin(runs: Sequence[MeasuredRun]) -> None:
            # Runs keep what is computed of them while the thread sends them: it gets copies.
            shown = _shown(campaign, [replace(run) for run in runs])
            begun.append(thread.submit(write_file, _FLAG, path, partial(_write, process, shown)))

        yield begin
        for done in begun:
            done.result()


def _shown(campaign: Campaign, runs: Sequence[MeasuredRun]) -> Recorded:
    numbers = condition_numbers(in_order(run.condition for run in runs))
    colours = {name: colour(number) for name, number in numbers.items()}
    events = reported_events(campaign, []).to_dict("records")
    counted = [run for run in runs if run.is_ok]
    return Recorded(plain(campaign.header.name), campaign.path, counted, colours, events)


def _write(process: Executor, shown: Recorded, path: Path) -> None:
    _run(process, Task("recording", write_recording_file, (shown, path)))


def _run(process: Executor, task: Task[str]) -> None:
    """Run a task and wait for it.

    Raises
    ------
    FileError
        If it fails.
    """
    for outcome in process.run([task], type(None)):
        if isinstance(outcome, Failed):
            raise FileError(outcome.cause)
