"""Marks, fixtures and hooks of a session that has benchmarks, registered when the first is found."""

from __future__ import annotations

from agvbench.pytest_plugin.against import pytest_runtest_setup
from agvbench.pytest_plugin.collection import (
    pytest_collection_modifyitems,
    pytest_generate_tests,
    pytest_make_collect_report,
)
from agvbench.pytest_plugin.fixtures import (
    agvbench_repeat,
    bench,
    drive,
    pytest_runtestloop,
    pytest_sessionfinish,
    pytest_unconfigure,
)
from agvbench.pytest_plugin.options import pytest_configure
from agvbench.pytest_plugin.session_output import (
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
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_generate_tests",
    "pytest_make_collect_report",
    "pytest_pyfunc_call",
    "pytest_report_teststatus",
    "pytest_runtest_makereport",
    "pytest_runtest_protocol",
    "pytest_runtest_setup",
    "pytest_runtestloop",
    "pytest_sessionfinish",
    "pytest_terminal_summary",
    "pytest_unconfigure",
]
