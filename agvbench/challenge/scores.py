"""Scores of blind trials: hidden effects against answers, every share with its exact bounds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from agvbench.challenge.trial import Trial
from agvbench.statistics.intervals import Proportion

_Z = 1.959963984540054
_THREE_FLOORS = 9.0
"""Squares at which refitted maps leave three times the repeatability, the least that sizes are drawn for: below it a
share of the excess depends on the dispersion of repeats as much as on what the model removes."""


def _one(trial: Trial) -> bool:
    return len(trial.hidden) == 1 and trial.outside == 0 and not trial.absorbed


def _outside(trial: Trial) -> bool:
    return len(trial.hidden) == 1 and trial.outside == 1


def _inside(trial: Trial) -> bool:
    return bool(trial.library_names) and not trial.outside and not trial.absorbed


def _leaves_three_floors(trial: Trial) -> bool:
    before, floor = (trial.squares_mm2.get(name, math.nan) for name in ("before", "floor"))
    return before >= _THREE_FLOORS * floor


Group = tuple[str, Callable[[Trial], bool]]
GROUPS: tuple[Group, ...] = (
    ("inside the library", _inside),
    ("inside the library, free maps left three floors", lambda t: _inside(t) and _leaves_three_floors(t)),
    ("outside, without random phase", lambda t: _outside(t) and not t.random_phase),
)

Criterion = tuple[str, Callable[[Trial], bool], Callable[[Trial], bool]]
CRITERIA: tuple[Criterion, ...] = (
    ("one of the library: named, or left open among its true rivals", _one, lambda t: t.is_right and t.is_final),
    ("one of the library: left open", _one, lambda t: t.verdict == "AMBIGUOUS"),
    ("one of the library: left open though it has no rival", lambda t: _one(t) and not t.rivals,
     lambda t: t.verdict == "AMBIGUOUS"),
    ("one that free maps take up: a wrong name", lambda t: t.absorbed and len(t.hidden) == 1,
     lambda t: bool(t.false_names)),
    ("nothing: ADEQUATE", lambda t: not t.hidden, lambda t: t.verdict == "ADEQUATE"),
    ("nothing: a name", lambda t: not t.hidden, lambda t: bool(t.named)),
    ("outside the library: a wrong name", _outside, lambda t: bool(t.false_names)),
    ("outside the library: UNKNOWN with the right first covariate", _outside,
     lambda t: t.verdict == "UNKNOWN" and bool(t.depends_on) and t.depends_on[0] in t.covariates),
    ("one inside, one outside: the inside one named and UNKNOWN said", lambda t: len(t.hidden) == 2 and t.outside == 1,
     lambda t: t.verdict == "UNKNOWN" and t.is_right),
    ("two of the library: both named", lambda t: len(t.hidden) == 2 and t.outside == 0,
     lambda t: t.is_right and t.is_final),
)  # fmt: skip


@dataclass(frozen=True)
class Scores:
    """What came of many trials.

    ``shares`` by question; ``confusion`` by what was hidden, then by answer; ``list_length`` the mean number of
    effects in an AMBIGUOUS answer; ``coverage`` of 95 % intervals where the forms agree; ``removed`` quantiles of the
    share of excess held-out error removed (0, 0.5), by group, where nodal maps leave an excess; ``worse_on`` trials
    with something predicted worse; ``errors`` the trials without an answer, each with its cause.
    """

    trials: int
    shares: Mapping[str, Proportion]
    confusion: Mapping[str, Mapping[str, int]]
    list_length: float
    coverage: Proportion
    removed: Mapping[str, tuple[float, float]]
    worse_on: int
    seconds: tuple[float, float]
    errors: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain content; numbers that are not finite are null."""
        content: dict[str, Any] = plain(asdict(self))
        return content


def score(trials: Sequence[Trial]) -> Scores:
    """Return the scores of trials."""
    confusion: dict[str, Counter[str]] = {}
    for trial in trials:
        confusion.setdefault(trial.spec, Counter())[trial.answer] += 1
    lists = [len({*t.named, *t.alternatives}) for t in trials if t.verdict == "AMBIGUOUS"]
    return Scores(
        len(trials),
        {text: Proportion.of(hit(t) for t in trials if counts(t)) for text, counts, hit in CRITERIA},
        {name: dict(answers) for name, answers in sorted(confusion.items())},
        sum(lists) / len(lists) if lists else math.nan,
        Proportion.of(covered for trial in trials for covered in coverings(trial)),
        {name: _worst_and_median(t.removed for t in trials if counts(t)) for name, counts in GROUPS},
        sum(bool(t.worse_on) for t in trials),
        _median_and_most([t.seconds for t in trials]),
        tuple(f"{t.spec}, seed {t.seed}: {t.error}" for t in trials if t.error),
    )


def coverings(trial: Trial) -> list[bool]:
    """Return for each parameter whose true value is known and estimated whether its 95 % interval covers it.

    An angle is compared on the circle.
    """
    found = []
    for name, truths in trial.true_parameters.items():
        for parameter, truth in truths.items():
            value, stderr = trial.estimates.get(name, {}).get(parameter, (math.nan, math.nan))
            if math.isfinite(value) and math.isfinite(stderr):
                error = value - truth
                if parameter == "direction_rad":
                    error = math.remainder(error, 2.0 * math.pi)
                found.append(abs(error) <= _Z * stderr)
    return found


def _worst_and_median(shares: Iterable[float]) -> tuple[float, float]:
    known = sorted(share for share in shares if math.isfinite(share))
    return (known[0], _median(known)) if known else (math.nan, math.nan)


def _median_and_most(values: Iterable[float]) -> tuple[float, float]:
    known = sorted(value for value in values if math.isfinite(value))
    return (_median(known), known[-1]) if known else (math.nan, math.nan)


def _median(ordered: Sequence[float]) -> float:
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])


def plain(content: Any) -> Any:
    """Return content for JSON: tuples as lists, numbers that are not finite as null."""
    if isinstance(content, dict):
        return {key: plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [plain(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
