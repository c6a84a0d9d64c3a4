"""The findings of ``agvbench doctor`` on the console, a line each as they come."""

from __future__ import annotations

from rich.markup import escape

from agvbench.reporting.console.tables import wide_console
from agvbench.reporting.content import plain_sentences
from agvbench.workflows.doctor import Finding, FindingState

_COLOURS = {
    FindingState.GOOD: "green",
    FindingState.DOUBTFUL: "yellow",
    FindingState.BAD: "bold red",
    FindingState.IDLE: "dim",
}
_NAME_WIDTH = 13
_STATE_WIDTH = max(len(state.value) for state in FindingState)


def print_finding(name: str, finding: Finding) -> FindingState:
    """Print a finding; return its state."""
    colour = _COLOURS[finding.state]
    state = f"[{colour}]{finding.state.value:<{_STATE_WIDTH}}[/{colour}]"
    line = f"{name:<{_NAME_WIDTH}} {state}  {escape(plain_sentences(finding.found))}"
    if finding.remedy:
        line += f"\n{'':<{_NAME_WIDTH + _STATE_WIDTH + 3}}→ {escape(plain_sentences(finding.remedy))}"
    wide_console().print(line)
    return finding.state
