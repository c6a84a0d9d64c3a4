"""The plugin's options and marks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from agvbench.running.options import OPTIONS, add_options, destination

if TYPE_CHECKING:
    from agvbench.running.settings import BenchSettings

_MARKS = (
    "repeats(n, full=None): drive n times (full times with --full); n=None follows --repeats",
    "grid(name, reduced, full): parametrize by `reduced`, with --full by `full`",
    "experiment(name): what the campaign calls the runs of this benchmark (default: the function's name)",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options of a bench session."""
    add_options(parser.getgroup("agvbench", "AGV bench").addoption)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks."""
    for mark in _MARKS:
        config.addinivalue_line("markers", mark)


def given_options(config: pytest.Config) -> dict[str, Any]:
    """Return the bench options that were given on the command line, by name."""
    values = {destination(flag): config.getoption(destination(flag)) for flag, _, _ in OPTIONS}
    return {name: value for name, value in values.items() if value is not None}


def settings_from(config: pytest.Config) -> BenchSettings:
    """Return the settings of the session: those that the command line asks for, or that a resumed one began with.

    Raises
    ------
    AgvbenchError
        If a value cannot be used, or what the session began with not be read.
    """
    from agvbench.running.session_settings import session_settings

    resume = bool(config.getoption("resume"))
    return session_settings(given_options(config), config.getoption("out"), resume=resume)[1]
