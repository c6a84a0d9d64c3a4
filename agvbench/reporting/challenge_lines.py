"""What the scores of blind trials say, in rows and lines, wherever they are shown."""

from __future__ import annotations

import math
from collections.abc import Iterator

from agvbench.challenge.scores import Scores
from agvbench.simulator.hidden.catalogue import AND

SHARES = ("", "count", "share", "95 % bounds")
ANSWERS = ("hidden", "answers")


def share_rows(scores: Scores) -> Iterator[tuple[str, str, str, str]]:
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
