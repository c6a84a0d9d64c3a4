"""The fixtures ``bench`` and ``drive``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from typing import TYPE_CHECKING

import pytest

from agvbench.errors import AgvbenchError, NotComparableError
from agvbench.pytest_plugin.against import AGAINST, is_left_out, prepare, write_analysis
from agvbench.pytest_plugin.collection import chosen, experiment, is_bench, phase, plan_of, repeat, run_name
from agvbench.pytest_plugin.options import given_options, option, worded
from agvbench.workflows.bench import COMPARISON_CODE

if TYPE_CHECKING:
    from agvbench.reporting.viewer.process import LiveView
    from agvbench.running.session.driver import Driver
    from agvbench.running.session.session import BenchSession

INTERRUPT = pytest.StashKey[KeyboardInterrupt]()
"""What ended the session before its time."""
STOPPED_IN = pytest.StashKey[str]()
"""The run in which a failure ended the driving."""
SESSION = pytest.StashKey["BenchSession"]()
LIVE: pytest.StashKey[LiveView] = pytest.StashKey()
"""The live view, where there is one."""
ENDS_PROGRAM = pytest.StashKey[bool]()
"""Whether a benchmark called `sys.exit`."""
IS_REPORTED = pytest.StashKey[bool]()
"""Whether all of the campaign could be reported at the end."""


@pytest.fixture
def agvbench_repeat(request: pytest.FixtureRequest) -> int:
    """Which repeat this is, from 1."""
    return int(request.param)


@pytest.hookimpl(wrapper=True)
def pytest_runtestloop(session: pytest.Session) -> Generator[None, object, object]:
    """Open the bench session before the first benchmark; what cannot be set up is one line, as bad usage."""
    config = session.config
    parallel = hasattr(config, "workerinput") or getattr(config.option, "dist", "no") != "no"
    if config.option.collectonly or parallel or not any(is_bench(item) for item in session.items):
        return (yield)
    from agvbench.metrics.registry import all_metrics  # only here: it loads numpy

    with ExitStack() as stack:
        with _ended_as_pytest_does(config):
            all_metrics()  # a mistake in one of the lab's is said before anything is driven
            against = prepare(config, session.items)
            bench_session = _opened(session, stack)
            if against is not None:
                against.begin(bench_session)
                config.stash[AGAINST] = against
        _announce(session, bench_session)
        with _ended_as_pytest_does(config):
            _show_live(config, bench_session, stack)
            done = yield
            if against is not None:
                write_analysis(config, against.analyse_last())
            stack.close()
            if against is not None:
                against.judge()
        return done


@contextmanager
def _ended_as_pytest_does(config: pytest.Config) -> Iterator[None]:
    """Turn bad input into bad usage, and keep what interrupted the session."""
    try:
        yield
    except AgvbenchError as error:
        if isinstance(error, NotComparableError):
            config.stash[COMPARISON_CODE] = error.exit_code
        raise pytest.UsageError(worded(config, error)) from None
    except KeyboardInterrupt as interrupt:
        config.stash[INTERRUPT] = interrupt
        raise


def _opened(session: pytest.Session, stack: ExitStack) -> BenchSession:
    """Open the session that the options describe, until `stack` is closed."""
    from agvbench.compiled import announcing_compilation
    from agvbench.running.session.opening import open_session

    config = session.config
    if is_live := _is_live(config):
        from agvbench.reporting.viewer.process import require_viewer

        require_viewer(option(config, "--viewer"))
    stack.enter_context(announcing_compilation(_progress_printer(config)))
    opened = open_session(
        given_options(config) | chosen(config, session.items),
        out=option(config, "--out"),
        resume=bool(option(config, "--resume")),
        dry_run=bool(option(config, "--dry-run")),
        plan=plan_of(session.items),
        on_progress=_progress_printer(config),
        listen=option(config, "--listen"),
        is_observed=is_live,
    )
    config.stash[SESSION] = stack.enter_context(opened)
    return config.stash[SESSION]


def _announce(session: pytest.Session, bench_session: BenchSession) -> None:
    """Tell the session which runs to expect, and people what the session has to say."""
    benches = [item for item in session.items if is_bench(item) and not is_left_out(item)]
    bench_session.expect([run_name(item) for item in benches], [run_name(item) for item in benches if phase(item) == 0])
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None:
        for notice in bench_session.notices:
            reporter.write_line(worded(session.config, notice))


def _show_live(config: pytest.Config, bench_session: BenchSession, stack: ExitStack) -> None:
    """Show the session in a viewer where that is asked for, until `stack` is closed."""
    if not _is_live(config):
        return
    from agvbench.reporting.viewer.process import live_view

    view = live_view(
        bench_session.directory, option(config, "--viewer"), _progress_printer(config), bench_session.state
    )
    config.stash[LIVE] = stack.enter_context(view)


def _is_live(config: pytest.Config) -> bool:
    """Whether the session is shown while it drives; a dry run has nothing to show."""
    is_asked = bool(option(config, "--live") or option(config, "--viewer"))
    return is_asked and not option(config, "--dry-run")


def _progress_printer(config: pytest.Config) -> Callable[[str], None]:
    """Return what prints to the operator while a benchmark is driven, whose output pytest captures."""
    from agvbench.running.positioning.start_pose import notify_operator

    capture = config.pluginmanager.get_plugin("capturemanager")

    def on_progress(text: str) -> None:
        with capture.global_and_fixture_disabled() if capture is not None else nullcontext():
            notify_operator(worded(config, text))

    return on_progress


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> Generator[None, object, object]:
    """End with the exit code that shells know of the signal that ended the session, or that of what failed.

    pytest's terminal reporter writes the report within this hook.
    """
    stash = session.config.stash
    if INTERRUPT in stash:
        from agvbench.running.session.termination_signals import exit_code

        session.exitstatus = exit_code(stash[INTERRUPT])
    elif AGAINST in stash and session.exitstatus == pytest.ExitCode.OK and (code := stash[AGAINST].exit_code):
        session.exitstatus = stash[COMPARISON_CODE] = code
    elif ENDS_PROGRAM in stash or (SESSION in stash and stash[SESSION].failure is not None):
        session.exitstatus = pytest.ExitCode.INTERRUPTED
    result = yield
    if not stash.get(IS_REPORTED, True) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.USAGE_ERROR
    return result


def pytest_unconfigure(config: pytest.Config) -> None:
    """Say last of all what ended the driving."""
    if (line := stop_line(config)) is not None and INTERRUPT not in config.stash:
        print(line, file=sys.stderr)


def stop_line(config: pytest.Config) -> str | None:
    """Return the line that says which failure ended the driving, and in which run; None where none did."""
    failure = config.stash[SESSION].failure if SESSION in config.stash else None
    if failure is None:
        return None
    where = f" in run {config.stash[STOPPED_IN]}" if STOPPED_IN in config.stash else ""
    remedy = "" if failure.remedy else "; correct it, then continue with --resume"
    return worded(config, f"ERROR: the bench was stopped{where}: {failure}{remedy}")


@pytest.fixture(scope="session")
def bench(request: pytest.FixtureRequest) -> BenchSession:
    """Return the bench session: rig, campaign and models."""
    if SESSION not in request.config.stash:
        pytest.fail("one vehicle drives one run at a time: leave -n out", pytrace=False)
    session: BenchSession = request.config.stash[SESSION]
    return session


@pytest.fixture
def drive(request: pytest.FixtureRequest, bench: BenchSession) -> Driver:
    """Drives this benchmark's run: ``drive.trajectory(...)`` or ``drive.hold(...)``."""
    item = request.node
    if not is_bench(item):
        pytest.fail("the fixture `drive` is for functions bench_* in files bench_*.py", pytrace=False)
    return bench.driver(run_name(item), experiment=experiment(item), repeat=repeat(item))
