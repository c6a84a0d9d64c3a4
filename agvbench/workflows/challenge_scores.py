"""How blind trials are scored: what was hidden against what was answered, every share with its exact bounds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

CONFIDENCE = 0.95
_Z = 1.959963984540054


@dataclass(frozen=True)
class Trial:
    """One blind trial.

    Parameters
    ----------
    spec, seed
        Which plant it was.
    kind, hidden, library_names, covariates, absorbed, random_phase
        The sealed truth: its kind; the names hidden; those of the library that should be found; what an unexplained
        rest depends on; whether free maps take it up; whether its phase is drawn anew for each run.
    true_parameters
        Of effects with the library's own equation: name to parameter to value.
    verdict, named, alternatives, depends_on
        The answer: the effects named, all the effects that may stand in for them, covariates of the rest in order.
    estimates
        Name to parameter to (value, standard error).
    squares_mm2
        Mean squared held-out position error: ``before``, ``after``, ``floor``.
    worse_on
        What the corrected model predicts worse.
    rivals
        True rivals of the hidden effects of the library, where they were asked for.
    seconds
        What the diagnosis took.
    """

    spec: str
    seed: int
    kind: str
    hidden: tuple[str, ...]
    library_names: tuple[str, ...]
    covariates: tuple[str, ...]
    absorbed: bool
    random_phase: bool
    true_parameters: Mapping[str, Mapping[str, float]]
    verdict: str
    named: tuple[str, ...]
    alternatives: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    estimates: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    squares_mm2: Mapping[str, float] = field(default_factory=dict)
    worse_on: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    seconds: float = math.nan

    @property
    def outside(self) -> int:
        """How many effects from outside the library are hidden."""
        return len(self.hidden) - len(self.library_names)

    @property
    def false_names(self) -> tuple[str, ...]:
        """Names given for which neither the truth nor a true rival of it stands."""
        return tuple(name for name in self.named if name not in {*self.library_names, *self.rivals})

    @property
    def is_right(self) -> bool:
        """Whether every hidden effect of the library was named, or left open among its true rivals, and no other."""
        if any(name not in {*self.library_names, *self.rivals} for name in (*self.named, *self.alternatives)):
            return False
        return set(self.library_names) <= {*self.named, *self.alternatives}

    @property
    def is_final(self) -> bool:
        """Whether the answer says that the effects named are all there is."""
        return self.verdict in {"NAMED", "AMBIGUOUS"}

    @property
    def answer(self) -> str:
        """The answer as one label."""
        return f"{self.verdict} {' + '.join(sorted(self.named))}".strip()

    @property
    def removed(self) -> float:
        """Share of the excess held-out squared error that the corrected model removes; NaN where there is none."""
        before, after, floor = (self.squares_mm2.get(name, math.nan) for name in ("before", "after", "floor"))
        return (before - after) / (before - floor) if before > 1.5 * floor else math.nan


@dataclass(frozen=True)
class Share:
    """``count`` of ``total``, with the bounds that hold with 95 % confidence (Clopper and Pearson 1934).

    Examples
    --------
    >>> share = Share.of([True] * 10)
    >>> share.value, round(share.low, 3), share.high
    (1.0, 0.692, 1.0)
    """

    count: int
    total: int
    low: float
    high: float

    @classmethod
    def of(cls, outcomes: Iterable[bool]) -> Share:
        """Return the share of outcomes that are true."""
        from scipy.stats import binomtest

        found = list(outcomes)
        if not found:
            return cls(0, 0, 0.0, 1.0)
        interval = binomtest(sum(found), len(found)).proportion_ci(CONFIDENCE, method="exact")
        return cls(sum(found), len(found), float(interval.low), float(interval.high))

    @property
    def value(self) -> float:
        """The share itself; NaN of nothing."""
        return self.count / self.total if self.total else math.nan


def _one(trial: Trial) -> bool:
    return len(trial.hidden) == 1 and trial.outside == 0 and not trial.absorbed


def _outside(trial: Trial) -> bool:
    return len(trial.hidden) == 1 and trial.outside == 1


Question = tuple[str, Callable[[Trial], bool], Callable[[Trial], bool]]
QUESTIONS: tuple[Question, ...] = (
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
    share of excess held-out error removed (0, 0.5), by group, where free maps leave an excess; ``worse_on`` trials with
    something predicted worse.
    """

    trials: int
    shares: Mapping[str, Share]
    confusion: Mapping[str, Mapping[str, int]]
    list_length: float
    coverage: Share
    removed: Mapping[str, tuple[float, float]]
    worse_on: int
    seconds: tuple[float, float]

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
        {text: Share.of(hit(t) for t in trials if counts(t)) for text, counts, hit in QUESTIONS},
        {name: dict(answers) for name, answers in sorted(confusion.items())},
        sum(lists) / len(lists) if lists else math.nan,
        Share.of(covered for trial in trials for covered in coverings(trial)),
        {
            "inside the library": _worst_and_median(
                t.removed for t in trials if t.library_names and not t.outside and not t.absorbed
            ),
            "outside, without random phase": _worst_and_median(
                t.removed for t in trials if _outside(t) and not t.random_phase
            ),
        },
        sum(bool(t.worse_on) for t in trials),
        _median_and_most([t.seconds for t in trials]),
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
