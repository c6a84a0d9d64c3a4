"""What all tests share: Hypothesis without deadlines, for machines are shared, and mistakes with their tracebacks."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
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


def _await_port(port: int, limit_s: float = 120.0) -> None:
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return
        time.sleep(0.1)


_NO_PAGE = ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")


class DaskCluster:
    """A scheduler and workers as processes of this machine, over TCP on loopback."""

    def __init__(self, folder: Path, port: int, *more: str) -> None:
        self.address, self._folder = f"tcp://127.0.0.1:{port}", folder
        self._more, self._processes = more, list[subprocess.Popen[bytes]]()
        self._start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-show", *_NO_PAGE)
        _await_port(port)

    def add_worker(self, *more: str) -> subprocess.Popen[bytes]:
        """Start a worker with one thread, or with the options `more`."""
        options = ("--no-nanny", "--no-dashboard", "--local-directory", str(self._folder))
        return self._start("worker", self.address, *options, *(more or ("--nthreads", "1")))

    def close(self) -> None:
        """End all processes that were started."""
        for process in self._processes:
            process.kill()
            process.wait()

    def _start(self, what: str, *arguments: str) -> subprocess.Popen[bytes]:
        program = "import sys; from dask.__main__ import main; sys.exit(main())"
        command = [sys.executable, "-W", "ignore", "-c", program, what, *arguments, *self._more]
        helpers = [str(Path(__file__).parent / name) for name in ("executors", "workflows")]
        path = os.pathsep.join([*helpers, os.environ.get("PYTHONPATH", "")])
        log = (self._folder / f"{what}-{len(self._processes)}.log").open("wb")
        environment = os.environ | {"PYTHONPATH": path}
        with log:
            process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=self._folder)
        self._processes.append(process)
        return process


@pytest.fixture(scope="session")
def start_cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., DaskCluster]]:
    """Return what starts a scheduler without workers, with further options of both."""
    pytest.importorskip("distributed")
    started = []

    def start(*more: str) -> DaskCluster:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        started.append(DaskCluster(tmp_path_factory.mktemp("dask"), port, *more))
        return started[-1]

    yield start
    for cluster in started:
        cluster.close()


@pytest.fixture(scope="session")
def dask_cluster(start_cluster: Callable[..., DaskCluster]) -> DaskCluster:
    """Return a scheduler with two workers that no test ends."""
    cluster = start_cluster()
    for _ in range(2):
        cluster.add_worker()
    return cluster


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
