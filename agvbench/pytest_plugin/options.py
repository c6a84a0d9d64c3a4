"""The plugin's options and marks: in pytest every option is named ``--agvbench-…``, since other plugins have theirs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import pytest

from agvbench.running.configuration.session_options import (
    OPTIONS,
    PYTEST_PREFIX,
    SHORT_NAMES,
    add_options,
    destination,
    in_pytest,
    prefixed,
)

if TYPE_CHECKING:
    from agvbench.running.configuration.settings import BenchSettings

_MARKS = (
    "repeats(n, full=None): drive n times (full times with --agvbench-full); n=None follows --agvbench-repeats",
    "grid(name, reduced, full): parametrize by `reduced`, with --agvbench-full by `full`",
    "trajectories: parametrize `trajectory` by --agvbench-trajectories (default: the eight and the folder's own)",
    "kinematics(kind): drive only vehicles of this kind, two_axle or differential",
    "experiment(name): what the campaign calls the runs of this benchmark (default: the function's name)",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options of a bench session."""
    group = parser.getgroup("agvbench", "AGV bench")
    add_options(group.addoption, PYTEST_PREFIX)
    group.addoption(SHORT_NAMES, action="store_true", help=argparse.SUPPRESS)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks."""
    for mark in _MARKS:
        config.addinivalue_line("markers", mark)


def worded(config: pytest.Config, message: object) -> str:
    """Return a message with the names that options have where the user gives them: here, or in ``agvbench bench``."""
    return str(message) if config.getoption(destination(SHORT_NAMES)) else in_pytest(str(message))


def option(config: pytest.Config, flag: str) -> Any:
    """Return the value of an option by its name in ``agvbench bench``; None if it was not given."""
    return config.getoption(destination(prefixed(flag)))


def given_options(config: pytest.Config) -> dict[str, Any]:
    """Return the bench options that were given on the command line, by name."""
    values = {destination(flag): option(config, flag) for flag, _, _ in OPTIONS}
    return {name: value for name, value in values.items() if value is not None}


def settings_from(config: pytest.Config) -> BenchSettings:
    """Return the settings of the session: those that the command line asks for, or that a resumed one began with.

    Raises
    ------
    AgvbenchError
        If a value cannot be used, or what the session began with not be read.
    """
    from agvbench.running.session.opening import session_settings

    resume = bool(option(config, "--resume"))
    return session_settings(given_options(config), option(config, "--out"), resume=resume)[1]
