"""The scores of blind trials on the console."""

from __future__ import annotations

import math

from rich import box
from rich.console import Console
from rich.table import Table

from agvbench.simulator.hidden.catalogue import AND
from agvbench.workflows.challenge_scores import Scores


def print_scores(scores: Scores, console: Console) -> None:
    """Print the shares with their bounds, the confusion matrix and the rest."""
    table = Table(title=f"{scores.trials} blind trials", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("", "count", "share", "95 % bounds"):
        table.add_column(heading, justify="left" if not heading else "right")
    for text, share in (*scores.shares.items(), ("95 % intervals that cover", scores.coverage)):
        value = f"{share.value:.1%}" if share.total else "–"
        table.add_row(text, f"{share.count} of {share.total}", value, f"{share.low:.1%} to {share.high:.1%}")
    console.print(table)
    answers = Table(title="hidden, and answered", box=box.SIMPLE_HEAD, title_justify="left")
    answers.add_column("hidden")
    answers.add_column("answers")
    for spec, counts in scores.confusion.items():
        ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
        answers.add_row(spec.replace(AND, " + "), ", ".join(f"{count} × {answer}" for answer, count in ordered))
    console.print(answers)
    for group, (worst, median) in scores.removed.items():
        if math.isfinite(median):
            text = f"excess held-out error removed, {group}: median {median:.3f}, worst {worst:.3f}"
            console.print(text, highlight=False, soft_wrap=True)
    if math.isfinite(scores.list_length):
        console.print(f"effects in an AMBIGUOUS answer: {scores.list_length:.1f} on average", highlight=False)
    console.print(f"something predicted worse than before: {scores.worse_on} trials", highlight=False)
    middle, most = scores.seconds
    console.print(f"time of a diagnosis: median {middle:.1f} s, longest {most:.1f} s", highlight=False)
