"""What all tests share: Hypothesis without deadlines, for machines are shared, and mistakes with their tracebacks."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A mistake of agvbench itself is to be seen, not told in one line.
os.environ.setdefault("AGVBENCH_DEBUG", "1")
# Printed tables are as wide as COLUMNS says, which a shell may have set to anything. Where readline is imported, as by
# pdb, it sets COLUMNS for the processes that tests start, past os.environ.
with suppress(ImportError):
    import readline  # noqa: F401
os.environ.pop("COLUMNS", None)
os.unsetenv("COLUMNS")

# Generous, since a shared machine may be many times slower than an idle one.
TIMEOUT_S, SLOW_TIMEOUT_S = 300, 1200
# `nox -s explore` sets how many times every property is tested, each time on fresh examples.
ROUNDS = int(os.environ.get("AGVBENCH_EXPLORE", "0"))

settings.register_profile(
    "agvbench",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    # The same commit has the same examples everywhere: a failure is reproducible and belongs to the change.
    derandomize=not ROUNDS,
)
settings.load_profile("agvbench")


@pytest.fixture
def free_port() -> Callable[[], int]:
    """Return what finds a free port of this machine."""

    def find() -> int:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return int(probe.getsockname()[1])

    return find


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Limit the time of every test; repeat one that depends on the wall clock once where it fails without hanging."""
    timed, repeated = (config.pluginmanager.has_plugin(name) for name in ("timeout", "rerunfailures"))
    for item in items:
        if timed and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(SLOW_TIMEOUT_S if item.get_closest_marker("slow") else TIMEOUT_S))
        if repeated and item.get_closest_marker("real_time"):
            item.add_marker(pytest.mark.flaky(reruns=1, reruns_delay=1, rerun_except="Timeout"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List every repeat with the failure that caused it."""
    for report in terminalreporter.getreports("rerun"):
        crash = getattr(report.longrepr, "reprcrash", None)
        why = crash.message if crash else report.longreprtext
        terminalreporter.write_line(f"REPEATED {report.nodeid} after: {why.partition(chr(10))[0]}")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Test every property `ROUNDS` times."""
    if ROUNDS and hasattr(metafunc.function, "hypothesis"):
        metafunc.fixturenames.append("exploration_round")
        metafunc.parametrize("exploration_round", range(1, ROUNDS + 1))


@pytest.fixture
def give_up() -> Callable[[Path, str], None]:
    """Return what takes a run out of a campaign to drive it again: its parts and their lines in SHA256SUMS."""

    def remove(campaign: Path, run_id: str) -> None:
        names = tuple(f"{table}.parquet/{run_id}.parquet" for table in ("runs", "commands", "poses"))
        for name in names:
            (campaign / name).unlink(missing_ok=True)
        listed = campaign / "SHA256SUMS"
        lines = listed.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [line for line in lines if not line.rstrip().endswith(names)]
        listed.write_text("".join(kept), encoding="utf-8")

    return remove


@pytest.fixture
def exploration_round(request: pytest.FixtureRequest) -> int:
    """Return the number of the round."""
    return int(request.param)
