"""The scores of blind trials on the console."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from agvbench.challenge.scores import Scores
from agvbench.reporting.challenge_lines import ANSWERS, SHARES, answer_rows, other_lines, share_rows


def print_scores(scores: Scores, console: Console) -> None:
    """Print the shares with their bounds, the confusion matrix and the rest."""
    table = Table(title=f"{scores.trials} blind trials", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in SHARES:
        table.add_column(heading, justify="left" if not heading else "right")
    for row in share_rows(scores):
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
