"""The scores of blind trials, on the console and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from agvbench.challenge.scores import Scores
from agvbench.reporting.pages import escape
from agvbench.simulator.hidden.catalogue import AND

SHARES = ("", "count", "share", "95 % bounds")
ANSWERS = ("hidden", "answers")


def proportion_rows(scores: Scores) -> Iterator[tuple[str, str, str, str]]:
    """Yield a row under `SHARES` for each question that some trial answers, and for the intervals."""
    for text, share in (*scores.shares.items(), ("95 % intervals that cover", scores.coverage)):
        if share.total:
            yield text, f"{share.count} of {share.total}", f"{share.value:.1%}", f"{share.low:.1%} to {share.high:.1%}"


def answer_rows(scores: Scores) -> Iterator[tuple[str, str]]:
    """Yield a row under `ANSWERS` for everything that was hidden: the confusion matrix without its zeros."""
    for spec, counts in scores.confusion.items():
        ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
        yield spec.replace(AND, " + "), ", ".join(f"{count} × {answer}" for answer, count in ordered)


def other_lines(scores: Scores) -> Iterator[str]:
    """Yield a line for each of the other scores that there are."""
    for group, (worst, median) in scores.removed.items():
        if math.isfinite(median):
            yield f"excess held-out error removed, {group}: median {median:.3f}, worst {worst:.3f}"
    if math.isfinite(scores.list_length):
        yield f"effects in an AMBIGUOUS answer: {scores.list_length:.1f} on average"
    yield f"something predicted worse than before: {scores.worse_on} trials"
    middle, most = scores.seconds
    yield f"time of a diagnosis: median {middle:.1f} s, longest {most:.1f} s"
    if scores.errors:
        yield f"trials that ended with an error, which counts as a wrong answer: {len(scores.errors)}"
        yield from scores.errors


def print_scores(scores: Scores, console: Console) -> None:
    """Print the shares with their bounds, the confusion matrix and the rest."""
    table = Table(title=f"{scores.trials} blind trials", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in SHARES:
        table.add_column(heading, justify="left" if not heading else "right")
    for row in proportion_rows(scores):
        table.add_row(*row)
    console.print(table)
    answers = Table(title="hidden, and answered", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ANSWERS:
        answers.add_column(heading)
    for answer in answer_rows(scores):
        answers.add_row(*answer)
    console.print(answers)
    for line in other_lines(scores):
        console.print(line, highlight=False, soft_wrap=True)


def scores_markdown(scores: Scores) -> str:
    """Return the shares with their bounds, the rest, and the confusion matrix."""
    lines = [f"{scores.trials} blind trials:", "", *_table(SHARES, proportion_rows(scores)), ""]
    lines += [f"- {escape(line)}" for line in other_lines(scores)]
    lines += ["", *_table(ANSWERS, answer_rows(scores)), ""]
    return "\n".join(lines)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield f"|{'---|' * len(headings)}"
    yield from (f"| {' | '.join(map(escape, row))} |" for row in rows)
