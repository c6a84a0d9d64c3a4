"""Results of contract checks on the console, a line each as they come."""

from __future__ import annotations

from rich.markup import escape

from agvbench.adapters.contract_checks import CheckResult
from agvbench.reporting.console.tables import wide_console
from agvbench.reporting.content import plain_sentences

_NAME_WIDTH = 15
_STATE_WIDTH = 6


def print_check(result: CheckResult) -> bool:
    """Print a result; return whether the check passed."""
    state, colour = ("ok", "green") if result.passed else ("failed", "bold red")
    line = f"{result.name:<{_NAME_WIDTH}} [{colour}]{state:<{_STATE_WIDTH}}[/{colour}]  "
    line += escape(plain_sentences(result.found))
    if result.remedy:
        line += f"\n{'':<{_NAME_WIDTH + _STATE_WIDTH + 3}}→ {escape(plain_sentences(result.remedy))}"
    wide_console().print(line)
    return result.passed
