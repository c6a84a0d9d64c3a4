"""Stability test: whether repeats differ by when they were driven.

Repeats that are spread over an evening differ by more than their repeatability if the vehicle changes meanwhile. In a
pooled standard deviation of repeats, such a change is indistinguishable from random errors.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.discrepancy.campaign_time import coarse_parts, exponentials, restarts
from agvbench.diagnosis.discrepancy.regression import FOLDS, Columns, winsorised
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.residuals.covariate_test import Dependence
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.types import Floats

CAMPAIGN_TIME, SESSION = "campaign_time_h", "session"
_PERMUTATIONS, _BATCH, _ENOUGH = 4999, 500, 10


def stability_test(
    rates: Rates, directions: Iterable[tuple[type[DiscrepancyTerm], Columns]], readings: Readings, seed: int
) -> list[Dependence]:
    """Return the dependence of repeats on campaign time, session or a logged column; none if it is not significant.

    Each run has a score for each physical quantity that may change (speed, steering gain, offset of an axle, drift,
    position of the markers, delay). Scores and courses of time are centred within groups of repeats. The statistic is
    the largest standardised product of any score with any course. Courses are exponentials, with and without a restart,
    parts of the campaign and sessions (tests of parameter instability: Nyblom 1989; Zeileis and Hornik 2007), and the
    logged columns.

    Logged columns are often correlated with time: a battery falls over the evening. If there are any, the share of the
    variance that each covariate predicts in groups left out decides which comes first. Those that are not predicted
    clearly worse follow.

    Times are permuted within groups of repeats. The p-value is therefore exact for errors that are exchangeable among
    repeats, with any distribution, and it includes the choice of the largest statistic (Westfall and Young 1993).
    Permutations end early if the p-value is certainly not significant (Besag and Clifford 1991).

    Parameters
    ----------
    rates
        The residual rates of all runs.
    directions
        Each term that depends on campaign time, with the regressors of its full change.
    readings
        The runs, of the same number as in `rates`.
    seed
        Seed of the permutations.
    """
    if not len(rates.run):
        return []
    names, scores = _scores(rates, directions, len(readings))
    labels, courses = _courses(readings)
    index = np.unique(readings.group, return_inverse=True)[1]
    scores, courses = _centred(scores, index), _centred(courses, index)
    scale = _permutation_deviation(scores, courses, index)
    used = scale > 1e-9 * max(float(scale.max(initial=0.0)), 1e-300)
    if not used.any():
        return []
    inverse = np.where(used, 1.0 / np.where(used, scale, 1.0), 0.0)
    statistics = np.abs(scores.T @ courses) * inverse
    quantity, course = np.unravel_index(int(np.argmax(statistics)), statistics.shape)
    share = float((scores[:, quantity] @ courses[:, course]) ** 2)
    share /= float(np.sum(scores[:, quantity] ** 2) * np.sum(courses[:, course] ** 2))
    p_value = _p_value(scores, courses, inverse, index, seed)
    if p_value >= RESIDUAL.dependence_alpha or share < RESIDUAL.min_share:
        return []
    if not readings.logged.columns:
        return [Dependence(labels[course], names[quantity], p_value, share)]
    observed = {label: float(statistics[:, np.equal(labels, label)].max()) for label in dict.fromkeys(labels)}
    p_values = {label: _p_value(scores, courses, inverse, index, seed, size) for label, size in observed.items()}
    significant = [label for label, p in p_values.items() if p < RESIDUAL.dependence_alpha]
    fold = folds(readings.group, FOLDS, seed)
    score = scores[:, quantity]
    errors = {label: _held_out_errors(score, courses[:, np.equal(labels, label)], fold) for label in significant}
    return [
        Dependence(label, names[quantity], p_values[label], 1.0 - float(errors[label].sum() / np.sum(score**2)))
        for label in _best_first(errors, index)
    ]


def _held_out_errors(score: Floats, courses: Floats, fold: NDArray[np.int64]) -> Floats:
    """Return the squared errors (R,) of a score that the best of the courses (R, k) predicts in the folds left out."""
    errors = np.zeros(len(score))
    for k in np.unique(fold):
        out = fold == k
        products, squares = score[~out] @ courses[~out], np.maximum(np.sum(courses[~out] ** 2, axis=0), 1e-300)
        best = int(np.argmax(products**2 / squares))
        errors[out] = (score[out] - products[best] / squares[best] * courses[out, best]) ** 2
    return errors


def _best_first(errors: dict[str, Floats], index: NDArray[np.int64]) -> list[str]:
    """Return the covariate with the least errors (R,), and those that predict no worse by more than chance."""
    order = sorted(errors, key=lambda label: float(errors[label].sum()))
    worse = {label: np.bincount(index, errors[label] - errors[order[0]]) for label in order}
    return [
        label
        for label, difference in worse.items()
        if difference.sum() <= RESIDUAL.validation_standard_errors * float(np.sqrt(np.sum(difference**2)))
    ]


def _scores(
    rates: Rates, directions: Iterable[tuple[type[DiscrepancyTerm], Columns]], runs: int
) -> tuple[list[str], Floats]:
    """Return what each score is of, and each run's scores (runs, q): products of residuals and regressors."""
    values = np.column_stack([winsorised(value) for value in rates.value.T])
    values *= rates.weight[:, None] / np.maximum(np.average(values**2, axis=0, weights=rates.weight), 1e-300)
    names, products = [], []
    for term, columns in directions:
        product = sum(values[:, [k]] * c for k, c in columns.items())
        names += [term.through] * np.shape(product)[1]
        products.append(product)
    steps = np.hstack(products)
    return names, np.column_stack([np.bincount(rates.run, step, minlength=runs) for step in steps.T])


def _courses(readings: Readings) -> tuple[list[str], Floats]:
    """Return what each course is of, and each run's share of the change (runs, k)."""
    hours = readings.started_h
    courses = [course.share for course in (*exponentials(hours), *restarts(hours), *coarse_parts(hours))]
    sessions = np.array([run.session or "" for run in readings.runs])
    several = [(sessions == name).astype(np.float64) for name in np.unique(sessions)[1:]]
    logged = list(readings.logged.standardised(len(readings)).T)
    labels = [CAMPAIGN_TIME] * len(courses) + [SESSION] * len(several)
    labels += [regressor.column for regressor in readings.logged.regressors]
    return labels, np.column_stack(courses + several + logged)


def _centred(values: Floats, index: NDArray[np.int64]) -> Floats:
    """Return values (R, k) without their means in groups (R,)."""
    count = np.bincount(index)
    means = np.column_stack([np.bincount(index, column) / count for column in values.T])
    return np.asarray(values - means[index])


def _permutation_deviation(scores: Floats, courses: Floats, index: NDArray[np.int64]) -> Floats:
    """Return the standard deviation (q, k) of products of centred scores and courses under permutations in groups."""
    dof = np.maximum(np.bincount(index) - 1, 1)
    of_scores, of_courses = (
        np.column_stack([np.bincount(index, column**2) for column in values.T]) for values in (scores, courses)
    )
    return np.asarray(np.sqrt((of_scores / dof[:, None]).T @ of_courses))


def _p_value(
    scores: Floats, courses: Floats, inverse: Floats, index: NDArray[np.int64], seed: int, size: float | None = None
) -> float:
    """Return the share of permutations within groups whose largest statistic is at least as large as the observed.

    By default the observed one is the largest of all; `size` is that of one covariate.
    """
    largest = float(np.max(np.abs(scores.T @ courses) * inverse)) if size is None else size
    observed = largest * (1.0 - 1e-12)
    rng, order = np.random.default_rng([0x57AB, seed]), np.argsort(index, kind="stable")
    courses, exceeded, drawn = courses[order], 0, 0
    while drawn < _PERMUTATIONS and exceeded < _ENOUGH:
        for _ in range(min(_BATCH, _PERMUTATIONS - drawn)):
            permuted = np.lexsort((rng.random(len(index)), index))
            exceeded += bool(np.max(np.abs(scores[permuted].T @ courses) * inverse) >= observed)
            drawn += 1
    return (1.0 + exceeded) / (1.0 + drawn)
