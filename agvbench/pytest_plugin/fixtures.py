"""The fixtures ``bench`` and ``drive``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from agvbench.errors import AgvbenchError
from agvbench.pytest_plugin.collecting import experiment, is_bench, repeat, run_name
from agvbench.pytest_plugin.options import given_options

if TYPE_CHECKING:
    from agvbench.running.driver import Driver
    from agvbench.running.session import BenchSession

SESSION = pytest.StashKey["BenchSession"]()


@pytest.fixture
def agvbench_repeat(request: pytest.FixtureRequest) -> int:
    """Which repeat this is, from 1."""
    return int(request.param)


@pytest.fixture(scope="session")
def bench(request: pytest.FixtureRequest) -> Iterator[BenchSession]:
    """Open the bench session: rig, campaign and models. What cannot be set up ends the session with one line."""
    config = request.config
    if hasattr(config, "workerinput"):
        pytest.fail("one vehicle drives one run at a time: leave -n out", pytrace=False)
    from agvbench.running.opening import open_session

    try:
        with open_session(
            given_options(config),
            out=config.getoption("out"),
            resume=bool(config.getoption("resume")),
            dry_run=bool(config.getoption("dry_run")),
        ) as session:
            config.stash[SESSION] = session
            yield session
    except AgvbenchError as error:
        pytest.exit(str(error), returncode=error.exit_code)


@pytest.fixture
def drive(request: pytest.FixtureRequest, bench: BenchSession) -> Driver:
    """Drives this benchmark's run: ``drive.trajectory(...)`` or ``drive.hold(...)``."""
    item = request.node
    if not is_bench(item):
        pytest.fail("the fixture `drive` is for functions bench_* in files bench_*.py", pytrace=False)
    return bench.driver(run_name(item), experiment=experiment(item), repeat=repeat(item))
