"""Output of a bench session: progress while it drives, and a summary when it is done."""

from __future__ import annotations

import time
from collections.abc import Collection, Generator
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest

from agvbench.campaign.completeness import planned_id
from agvbench.errors import AgvbenchError, FitError, FlagError, InputError, PlanError
from agvbench.pytest_plugin.against import against_texts, is_left_out, take_analysis
from agvbench.pytest_plugin.collection import is_bench, run_name
from agvbench.pytest_plugin.fixtures import ENDS_PROGRAM, INTERRUPT, IS_REPORTED, LIVE, SESSION, STOPPED_IN, stop_line
from agvbench.pytest_plugin.options import option, worded

if TYPE_CHECKING:
    from agvbench.running.session.session import BenchSession

_BAR = 24
_STOPPED = "stopped"
_PROGRESS = pytest.StashKey["Progress"]()
_NOT_DRIVEN = pytest.StashKey[int]()


class Progress:
    """Counts the runs `left` to drive; draws one line on a terminal, and one line in ten elsewhere.

    ``what`` is done with them. Runs that an earlier session finished are not among them, or the time left would follow
    from runs that take none.
    """

    def __init__(self, reporter: pytest.TerminalReporter, left: Collection[str], what: str = "") -> None:
        self._reporter, self._left, self._what = reporter, frozenset(left), what
        self._total, self._done, self._reported = len(self._left), 0, 0
        self._began: float | None = None

    def begin(self, run_id: str, name: str) -> None:
        """Print what is driven now."""
        if run_id not in self._left:
            return
        line = self._line(name)
        if self._reporter.isatty:
            self._reporter.rewrite(line, erase=True)
        elif self._done * 10 // self._total > self._reported:
            self._reported = self._done * 10 // self._total
            self._reporter.write_line(line)
        self._done += 1

    def leave_out(self, run_id: str, *, begun: bool = True) -> None:
        """Do not count a run that is not driven, or the one that began last: this vehicle cannot drive it here."""
        if run_id in self._left:
            self._total, self._done = self._total - 1, self._done - begun

    def end(self) -> None:
        """Wipe the line."""
        if self._reporter.isatty:
            self._reporter.rewrite("", erase=True)

    def _line(self, name: str) -> str:
        self._began = time.monotonic() if self._began is None else self._began
        share = self._done / self._total
        elapsed = time.monotonic() - self._began
        left = f"{_clock(elapsed / share - elapsed)} left" if self._done > 2 else "…"
        bar = "█" * round(share * _BAR) + "·" * (_BAR - round(share * _BAR))
        return f"{bar} {self._done}/{self._total} runs{self._what}  {_clock(elapsed)} elapsed  {left}  {name}"


def _clock(seconds: float) -> str:
    """Return minutes and seconds.

    >>> _clock(125.3)
    '2:05'
    """
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _progress(session: pytest.Session) -> Progress | None:
    config = session.config
    if _PROGRESS not in config.stash:
        reporter = config.pluginmanager.get_plugin("terminalreporter")
        runs = {run_name(item) for item in session.items if is_bench(item)}
        if reporter is None or not runs:
            return None
        opened = config.stash.get(SESSION, None)
        done, is_dry = (opened.done, opened.is_dry) if opened is not None else (set[str](), False)
        config.stash[_PROGRESS] = Progress(reporter, runs - done, " planned" if is_dry else "")
    return config.stash[_PROGRESS]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> bool | None:
    """Draw the progress line before each benchmark; after a failure that ended the driving, only count it."""
    if not is_bench(item):
        return None
    stash = item.config.stash
    if SESSION in stash and stash[SESSION].failure is not None:
        stash[_NOT_DRIVEN] = stash.get(_NOT_DRIVEN, 0) + 1
        return True
    if LIVE in stash:
        stash[LIVE].check()
    take_analysis(item)
    if (progress := _progress(item.session)) is None:
        return None
    if is_left_out(item):
        progress.leave_out(run_name(item), begun=False)
    else:
        progress.begin(run_name(item), item.name.removeprefix("bench_"))
    return None


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    """Count what was not driven, for a reason that is no failure, as skipped."""
    if not is_bench(pyfuncitem):
        return (yield)
    from agvbench.running.session.driver import NotDrivenError

    try:
        return (yield)
    except NotDrivenError as reason:
        pytest.skip(worded(pyfuncitem.config, reason))
    except SystemExit as error:
        pyfuncitem.config.stash[ENDS_PROGRAM] = True
        remedy = "return, or raise an error that says what is wrong"
        raise InputError("a benchmark called sys.exit", value=error.code, remedy=remedy) from None
    finally:
        _leave_out_undrivable(pyfuncitem)


def _leave_out_undrivable(item: pytest.Function) -> None:
    """Lower the number of runs by one that turns out to need what this vehicle or floor does not have."""
    stash = item.config.stash
    if SESSION in stash and _PROGRESS in stash and run_name(item) in stash[SESSION].not_applicable:
        stash[_PROGRESS].leave_out(run_name(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Report a user's error in one line instead of a traceback; mark reports of benchmarks."""
    report = yield
    if is_bench(item):
        report.user_properties.append(("agvbench", item.name))
        if SESSION in item.config.stash and _is_conclusive(report, call):
            item.config.stash[SESSION].concluded(run_name(item))
        if report.when == "teardown":  # whose properties pytest writes
            report.user_properties += _errors(item)
        if call.excinfo is not None and isinstance(call.excinfo.value, AgvbenchError):
            report.longrepr = f"{item.name}: {worded(item.config, call.excinfo.value)}"
        _report_stop(item, report)
    return report


def _errors(item: pytest.Item) -> list[tuple[str, object]]:
    """Return the errors of a benchmark's last run by their columns, for JUnit XML; none where it has no target."""
    run = item.config.stash[SESSION].last_driven if SESSION in item.config.stash else None
    if run is None or not item.config.getoption("xmlpath", None) or planned_id(run.run_id) != run_name(item):
        return []
    with suppress(InputError, FitError):
        return [(name, round(value, 4)) for name, value in vars(run.error).items() if name != "delta_heading_deg"]
    return []


def _report_stop(item: pytest.Item, report: pytest.TestReport) -> None:
    """Say at once what ended the driving, and in which run; its report is counted, and not printed again."""
    stash = item.config.stash
    if SESSION not in stash or stash[SESSION].failure is None or STOPPED_IN in stash:
        return
    stash[STOPPED_IN] = run_name(item)
    report.user_properties.append((_STOPPED, True))
    reporter = item.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None:
        stash[_PROGRESS].end()
        reporter.write_line(str(stop_line(item.config)))


def _is_conclusive(report: pytest.TestReport, call: pytest.CallInfo[None]) -> bool:
    """Whether nothing more is to be expected of a benchmark: it was driven, or cannot be."""
    if call.excinfo is not None and isinstance(call.excinfo.value, PlanError | FlagError):
        return True
    return report.skipped or (report.when == "call" and report.passed)


@pytest.hookimpl(tryfirst=True)
def pytest_report_teststatus(report: pytest.TestReport | pytest.CollectReport) -> tuple[str, str, str] | None:
    """Leave the dots of passed benchmarks to the progress line."""
    if not isinstance(report, pytest.TestReport) or "agvbench" not in dict(report.user_properties):
        return None
    if _STOPPED in dict(report.user_properties):
        return _STOPPED, "", ""
    if report.when == "call" or report.skipped:
        return report.outcome, "", ""
    return None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """End with the summary table, and say where campaign and report are."""
    if _PROGRESS in config.stash:
        config.stash[_PROGRESS].end()
    why = str(config.stash[INTERRUPT]) or "Ctrl-C" if INTERRUPT in config.stash else ""
    session = config.stash.get(SESSION, None)
    if session is None:
        if why:
            terminalreporter.write_line(f"ended by {why}, nothing was driven")
        return
    from agvbench.running.configuration.campaign_directory import shown

    directory = shown(session.directory)
    if why:
        text = f"ended by {why}, the vehicle was stopped; go on with --resume --out {directory}"
        terminalreporter.write_line(worded(config, text))
        return
    if count := config.stash.get(_NOT_DRIVEN, 0):
        terminalreporter.write_line(f"{count} runs after it were not driven")
    if config.getoption("no_summary") and not session.is_dry:
        return
    try:
        _conclude(terminalreporter, config, session)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"no report; agvbench report {directory} writes it") from None


def _conclude(terminalreporter: pytest.TerminalReporter, config: pytest.Config, session: BenchSession) -> None:
    from agvbench.reporting.console.bench import bench_summary, dry_run_table
    from agvbench.running.configuration.campaign_directory import shown

    if session.is_dry:
        terminalreporter.write_line(dry_run_table(session.planned))
    else:
        for line in session.events:
            terminalreporter.write_line(worded(config, line))
        text, config.stash[IS_REPORTED] = bench_summary(
            shown(session.directory), report=not option(config, "--no-report")
        )
        terminalreporter.write_line(text)
        for text in against_texts(config):
            terminalreporter.write_line(text)
