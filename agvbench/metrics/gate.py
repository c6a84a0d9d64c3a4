"""Gates: limits on metrics of a campaign, absolute or against an earlier campaign, that a nightly job must keep.

A rule such as ``position_error.p95>+10%`` fails where the 95th percentile is shown to have grown by more than a tenth:
a one-sided permutation or rank-sum test (Good 2005, Permutation, Parametric and Bootstrap Tests of Hypotheses, section
3.2), with the later values reduced by the allowed growth. Holm's correction covers all rules, trajectories and
conditions. A rule without a plus sign, such as ``position_error.p95>30mm``, compares the statistic itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import InputError, OneOf
from agvbench.metrics.gate_rules import SIGNED, STATISTICS, TWO_SIDED, GateRule, Statistic
from agvbench.statistics.differences import ALPHA
from agvbench.statistics.hypothesis_tests import holm_tarone, minimum_attainable_p, rank_test, tarone_testable
from agvbench.types import RUN_OK, Floats

if TYPE_CHECKING:
    import pandas as pd

RESAMPLES = 20_000


class GateVerdict(StrEnum):
    """What repeats say about a rule."""

    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    PASS = "pass"  # noqa: S105 - no password


@dataclass(frozen=True)
class GateCheck:
    """A rule on one trajectory and condition: the statistic before (NaN without) and now, and what is allowed.

    ``is_beyond`` says whether the statistic itself is beyond what is allowed, whether or not chance explains it.
    ``p_value`` is that of a growth beyond the limit, corrected for all checks; NaN where the limit is absolute. A check
    is inconclusive where no difference of so few repeats could be significant.
    """

    rule: GateRule
    trajectory: str
    condition: str
    repeats_a: int
    repeats_b: int
    before: float
    now: float
    allowed: float
    is_beyond: bool
    p_value: float
    verdict: GateVerdict


def check_gate(
    rules: Sequence[GateRule],
    b: pd.DataFrame,
    a: pd.DataFrame | None = None,
    *,
    conditions: tuple[str, str] | None = None,
    alpha: float = ALPHA,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> list[GateCheck]:
    """Check `rules` on the metrics of campaign `b`, and on their growth since campaign `a`; rules with failures first.

    Parameters
    ----------
    rules
        What is limited.
    a, b
        What `metric_table` returns. Only runs that count are used.
    conditions
        The condition of `a` that is compared with that of `b`; without it equal ones are compared.
    alpha
        The chance that any rule on growth fails where nothing has grown.
    resamples, seed
        Of the permutation test.

    Raises
    ------
    InputError
        If a rule on growth has no campaign to compare with, or a rule applies to nothing.
    """
    checks, minimum_p = [], []
    for rule in rules:
        found = list(_checks(rule, b, a, conditions, resamples, seed))
        if not found:
            raise _unused(rule, b)
        checks += [check for check, _ in found]
        minimum_p += [least for _, least in found]
    decided = sorted(_decided(checks, minimum_p, alpha), key=_severity)
    order = list(dict.fromkeys(check.rule for check in decided))
    return sorted(decided, key=lambda check: order.index(check.rule))


def _unused(rule: GateRule, b: pd.DataFrame) -> InputError:
    """Return what to say of a rule that applies to nothing, with what was driven."""
    what = "the rule applies to no trajectory and condition of the campaigns"
    rows = b[b["metric"] == rule.metric]
    driven = sorted({f"{one.trajectory} {one.condition}" for one in rows.itertuples()})
    value = " ".join([rule.text, *(f"[{', '.join(names)}]" for names in (rule.trajectories, rule.conditions) if names)])
    limit = OneOf(driven or sorted(set(b["metric"])))
    return InputError(what, where="gate", value=value, limit=limit, remedy="drive them, or correct the rule")


def _checks(
    rule: GateRule,
    b: pd.DataFrame,
    a: pd.DataFrame | None,
    conditions: tuple[str, str] | None,
    resamples: int,
    seed: int,
) -> Iterator[tuple[GateCheck, float]]:
    """Yield the checks of a rule before correction, each with the smallest p-value that its test could give."""
    if rule.is_growth and a is None:
        raise InputError("a limit on growth needs an earlier campaign", where="gate", value=rule.text)
    now, before = _values(b, rule), {} if a is None else _values(a, rule)
    for (trajectory, condition), values in now.items():
        if not rule.applies_to(trajectory, condition) or (conditions and condition != conditions[1]):
            continue
        earlier = before.get((trajectory, conditions[0] if conditions else condition), np.empty(0))
        if rule.is_growth and not len(earlier):
            continue
        statistic = STATISTICS[rule.statistic]
        past = float(statistic(earlier)) if len(earlier) else np.nan
        applied = rule.with_repeats(float(STATISTICS["sd"](earlier))) if rule.is_growth else rule
        p = growth_p_value(applied, earlier, values, resamples=resamples, seed=seed) if rule.is_growth else np.nan
        least = _least_p(rule, len(earlier), len(values), resamples)
        label = " → ".join(conditions) if conditions else condition
        counts = len(earlier), len(values)
        present = float(statistic(values))
        limit = applied.allowed(past, present), applied.is_exceeded(past, present)
        pending = GateVerdict.INCONCLUSIVE
        yield GateCheck(rule, trajectory, label, *counts, past, present, *limit, p, pending), least


def _least_p(rule: GateRule, n_a: int, n_b: int, resamples: int) -> float:
    """Return the smallest p-value that the test of a rule could give."""
    if not rule.is_growth or (rule.unit == "sd" and n_a < 2):
        return 1.0
    exact = minimum_attainable_p(n_a, n_b)
    if rule.statistic in ("mean", "bias", "sd"):
        return (2.0 if rule.statistic in TWO_SIDED else 1.0) * max(exact, 1.0 / (resamples + 1))
    return exact if rule.statistic == "median" else 2.0 * exact


def _values(table: pd.DataFrame, rule: GateRule) -> dict[tuple[str, str], Floats]:
    """Return the values of a rule's metric by trajectory and condition: absolute or signed ones."""
    rows = table[(table["metric"] == rule.metric) & (table["status"] == RUN_OK)]
    groups = rows.groupby(["trajectory", "condition"], sort=False)["value"]
    signed = rule.statistic in SIGNED
    found = {(str(t), str(c)): values.to_numpy(dtype=float) for (t, c), values in groups}
    return {cell: values if signed else np.abs(values) for cell, values in found.items()}


def growth_p_value(rule: GateRule, a: Floats, b: Floats, *, resamples: int = RESAMPLES, seed: int = 0) -> float:
    """Return the p-value that the statistic of `b` (m,) exceeds what is allowed after `a` (n,), one-sided.

    The values of `b` are divided by the allowed growth, or shifted by it, so that both samples are exchangeable where
    the growth is exactly the allowed one; those of ``sd`` are centred first. ``median`` is tested by rank sums, and
    ``mean`` and ``sd`` by permutation; ``bias`` likewise, in both directions (twice the smaller p-value). Few repeats
    hardly have a 95th percentile: ``p95`` and ``max`` take twice the smaller p-value of both tests (Bonferroni).
    """
    statistic = STATISTICS[rule.statistic]
    if rule.statistic in TWO_SIDED:
        allowed = abs(rule.allowed(float(statistic(a))) - float(statistic(a)))
        sides = ((a, b - allowed), (-a, -b - allowed))
        return min(1.0, 2.0 * min(_permutation_p(statistic, *side, resamples, seed) for side in sides))
    if rule.statistic == "sd":
        a, b = a - np.mean(a), b - np.mean(b)
    reduced = b / _ratio(rule, float(statistic(a))) if _scales(rule) else b - rule.limit
    if rule.statistic == "median":
        return rank_test([(a, reduced)]).p_greater
    permuted = _permutation_p(statistic, a, reduced, resamples, seed)
    if rule.statistic in ("mean", "sd"):
        return permuted
    return min(1.0, 2.0 * min(permuted, rank_test([(a, reduced)]).p_greater))


def _permutation_p(statistic: Statistic, a: Floats, b: Floats, resamples: int, seed: int) -> float:
    """Return the share of random divisions of all values in which the statistics differ at least as much as here."""
    observed = float(statistic(b) - statistic(a))
    shuffled = np.random.default_rng(seed).permuted(np.tile(np.concatenate([a, b]), (resamples, 1)), axis=1)
    apart = statistic(shuffled[:, len(a) :]) - statistic(shuffled[:, : len(a)])
    # Sums of the same numbers in another order differ by rounding.
    return float((1 + np.sum(apart >= observed - 1e-12 * max(1.0, abs(observed)))) / (resamples + 1))


def _scales(rule: GateRule) -> bool:
    """Return whether the allowed growth is a factor; a standard deviation cannot be shifted."""
    return rule.unit == "%" or rule.statistic == "sd"


def _ratio(rule: GateRule, before: float) -> float:
    return rule.allowed(before) / before if before > 0.0 else 1.0


def _decided(checks: Sequence[GateCheck], minimum_p: Sequence[float], alpha: float) -> Iterator[GateCheck]:
    """Yield the checks with corrected p-values and verdicts."""
    growth = [k for k, check in enumerate(checks) if check.rule.is_growth]
    least = [minimum_p[k] for k in growth]
    corrected = dict(zip(growth, holm_tarone([checks[k].p_value for k in growth], least, alpha), strict=True))
    testable = dict(zip(growth, tarone_testable(least, alpha), strict=True))
    for k, check in enumerate(checks):
        if k not in corrected:
            yield replace(check, verdict=GateVerdict.FAIL if check.is_beyond else GateVerdict.PASS)
        elif not testable[k]:
            yield replace(check, p_value=1.0)
        else:
            failed = check.is_beyond and corrected[k] <= alpha
            yield replace(check, p_value=corrected[k], verdict=GateVerdict.FAIL if failed else GateVerdict.PASS)


def _severity(check: GateCheck) -> tuple[int, float]:
    scale = check.allowed if check.allowed > 0.0 else 1.0
    return list(GateVerdict).index(check.verdict), -check.now / scale
