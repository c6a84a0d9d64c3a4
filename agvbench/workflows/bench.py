"""``agvbench bench``: hand the benchmarks to pytest, and its verdict back."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from agvbench.errors import INTERNAL_ERROR_EXIT_CODE, FileError, FlagError
from agvbench.running.configuration.benchmark_files import find_benchmark
from agvbench.running.configuration.campaign_directory import choose_directory
from agvbench.running.configuration.session_options import (
    OPTIONS,
    PYTEST_PREFIX,
    SESSION_OPTIONS,
    SHORT_NAMES,
    as_flag,
    destination,
)
from agvbench.running.configuration.settings import SETTINGS_FILE, BenchSettings

_SIGNALLED = 128
"""Exit codes above are those of sessions that a signal ended, and that have said so."""
COMPARISON_CODE = pytest.StashKey[int]()
"""The exit code of the comparison with an earlier campaign, where it ends the session."""
DEFAULT = ("calibration", "trajectories")
"""What is driven where no benchmark is named; the first only where no calibration is given."""
# The command line has imported agvbench before pytest looks for plugins, which does no harm here.
_IN_PROCESS = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"

# Where Hypothesis is installed, its plugin takes a second to import; properties are no benchmarks.
_UNUSED = "no:hypothesispytest"


def run_benchmarks(
    names: Sequence[str],
    options: Mapping[str, Any],
    *,
    only: str | None = None,
    junit: str | None = None,
    summary: bool = True,
) -> int:
    """Run the benchmarks `names` with `options`; return the exit code of ``agvbench``.

    ``only`` chooses among them as pytest's ``-k`` does; pytest writes its results to the file `junit`, as JUnit XML;
    without ``summary`` nothing is said at the end. A session that
    is resumed without saying which benchmarks drives those that it began with.

    Raises
    ------
    AgvbenchError
        If a benchmark does not exist, no run is chosen, or the session to be resumed cannot be read.
    """
    if options.get("resume") and not names:
        began = _begun_with(options.get("out"))
        names, only = began.benchmarks, only or began.only
    usual = DEFAULT[1:] if options.get("calibration") else DEFAULT
    files = [str(find_benchmark(name)) for name in names or usual]
    quiet = ["-q", "--strict-markers", "-p", "no:cacheprovider", "-p", _UNUSED, "-W", _IN_PROCESS]
    arguments = [*files, *quiet, SHORT_NAMES, *_flags(options)]
    if only:
        arguments += ["-k", only]
    if junit:
        _require_writable(Path(junit))
        arguments += [f"--junitxml={junit}"]
    if not summary:
        arguments += ["--no-summary", "-q"]
    ending = _Ending()
    try:
        code = pytest.main(arguments, plugins=[ending])
    except KeyboardInterrupt:
        if ending.code < _SIGNALLED:
            raise
        code = ending.code
    if code == pytest.ExitCode.NO_TESTS_COLLECTED:
        where, value = ("-k", only) if only else ("agvbench bench", " ".join(names))
        raise FlagError("no run to drive", where=where, value=value, remedy="see what there is with --dry-run")
    if ending.verdict is not None and code in (ending.verdict, pytest.ExitCode.USAGE_ERROR):
        return ending.verdict
    # Codes of pytest that agvbench uses for something else.
    own = {int(pytest.ExitCode.USAGE_ERROR): 2, int(pytest.ExitCode.INTERNAL_ERROR): INTERNAL_ERROR_EXIT_CODE}
    return own.get(int(code), int(code))


def _require_writable(file: Path) -> None:
    """Raise `FileError` if a file cannot be written: pytest would say so after the last run, and say nothing else."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a"):
            pass
    except OSError as error:
        raise FileError("cannot be written", where=f"--junitxml {file}", value=error.strerror) from None


class _Ending:
    """Ends pytest by Ctrl-C without its own words on it, and keeps the session's exit code."""

    code = 0
    verdict: int | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        # pytest interrupts itself, too: where a file cannot be collected.
        if not isinstance(excinfo.value, pytest.Session.Interrupted):
            raise excinfo.value

    @pytest.hookimpl(wrapper=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> Generator[None, None, None]:
        yield
        self.code = int(session.exitstatus)
        self.verdict = session.config.stash.get(COMPARISON_CODE, None)


def _begun_with(out: str | None) -> BenchSettings:
    """Return what the session to be resumed began with; the usual settings where there is none."""
    directory = choose_directory(out, resume=True)
    return BenchSettings.load(directory) if (directory / SETTINGS_FILE).exists() else BenchSettings()


def _flags(options: Mapping[str, Any]) -> list[str]:
    known = [flag for flag, _, _ in OPTIONS + SESSION_OPTIONS]
    return [text for flag in known for text in as_flag(flag, options.get(destination(flag)), PYTEST_PREFIX)]
