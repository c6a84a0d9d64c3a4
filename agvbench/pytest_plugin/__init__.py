"""The pytest plugin: benchmarks are functions ``bench_*`` in files ``bench_*.py`` that drive a vehicle.

::

    @pytest.mark.repeats(10)
    @pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
    def bench_my_turn(drive, condition):
        drive.trajectory("my_turn.toml", condition=condition)

Fixtures: ``drive`` (see `agvbench.running.driver.Driver`) and ``bench`` (the session). Marks: ``repeats``, ``grid``,
``experiment``. The plugin is found through its entry point; it stays idle, and imports nothing heavy, in sessions
that collect no benchmarks.
"""

from __future__ import annotations

from agvbench.pytest_plugin.collecting import (
    pytest_collect_file,
    pytest_collection_modifyitems,
    pytest_generate_tests,
)
from agvbench.pytest_plugin.fixtures import (
    agvbench_repeat,
    bench,
    drive,
    pytest_runtestloop,
    pytest_sessionfinish,
    pytest_unconfigure,
)
from agvbench.pytest_plugin.options import pytest_addoption, pytest_configure
from agvbench.pytest_plugin.telling import (
    pytest_pyfunc_call,
    pytest_report_teststatus,
    pytest_runtest_makereport,
    pytest_runtest_protocol,
    pytest_terminal_summary,
)

__all__ = [
    "agvbench_repeat",
    "bench",
    "drive",
    "pytest_addoption",
    "pytest_collect_file",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_generate_tests",
    "pytest_pyfunc_call",
    "pytest_report_teststatus",
    "pytest_runtest_makereport",
    "pytest_runtest_protocol",
    "pytest_runtestloop",
    "pytest_sessionfinish",
    "pytest_terminal_summary",
    "pytest_unconfigure",
]
