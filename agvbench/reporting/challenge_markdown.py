"""The scores of blind trials as Markdown, for a page of documentation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from agvbench.challenge.scores import Scores
from agvbench.reporting.challenge_lines import ANSWERS, SHARES, answer_rows, other_lines, share_rows
from agvbench.reporting.markdown import escape


def scores_markdown(scores: Scores) -> str:
    """Return the shares with their bounds, the rest, and the confusion matrix."""
    lines = [f"{scores.trials} blind trials:", "", *_table(SHARES, share_rows(scores)), ""]
    lines += [f"- {escape(line)}" for line in other_lines(scores)]
    lines += ["", *_table(ANSWERS, answer_rows(scores)), ""]
    return "\n".join(lines)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield f"|{'---|' * len(headings)}"
    yield from (f"| {' | '.join(map(escape, row))} |" for row in rows)
