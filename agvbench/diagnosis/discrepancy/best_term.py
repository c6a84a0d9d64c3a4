"""The discrepancy term that predicts best beside a model: initial values by regression or linearisation, and fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import DISCREPANCY
from agvbench.diagnosis.data.logged import RUN_ORDER
from agvbench.diagnosis.discrepancy.campaign_time import is_constant
from agvbench.diagnosis.discrepancy.command_history import command_history
from agvbench.diagnosis.discrepancy.screening import Start, screen
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.selection.candidates import applies, candidate
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.stepwise import Selector
from agvbench.diagnosis.terms import TERMS, ByLoggedColumn, DiscrepancyTerm
from agvbench.diagnosis.terms.campaign_time import ByCampaignTime

_MAX_STARTS = 8
_SMALL = 0.1  # of the typical size of a term
_COORDINATES = frozenset({"x_m", "y_m"})


def screened_terms(extended: Selector, root: ScoredModel) -> list[Start]:
    """Return initial values of the terms with the largest predicted gains beside `root`, the best first.

    Noise of the poses hides from rates a small bias that lasts for whole runs. If no term is found in the rates of a
    model that lacks fit, the poses decide.
    """
    starts = likely_terms(regressed_terms(extended, root))
    if not starts and has_lack_of_fit(root):
        starts = linearised_terms(extended, root, terms_without_regression(extended), extended.min_gain)
    return starts[: DISCREPANCY.max_starts]


def likely_terms(starts: list[Start]) -> list[Start]:
    """Return the terms that a regression predicts to gain enough, and a share of what the best of them gains."""
    largest = max((start.gain for start in starts), default=0.0)
    least = max(DISCREPANCY.min_predicted_gain, DISCREPANCY.min_share_of_best_start * largest)
    return [start for start in starts if start.gain > least]


def regressed_terms(extended: Selector, root: ScoredModel) -> list[Start]:
    """Return initial values of terms by regression of the residual rates of `root`, the largest gain first."""
    batch = extended.batch
    poses = root.fit.predictor.predict(root.fit.parameters)
    rates = residual_rates(batch.readings, poses)
    history = command_history(batch, root.fit.parameters, rates)
    return screen(rates, history, batch.geometry, batch.readings.group, extended.seed)


def linearised_terms(
    extended: Selector, root: ScoredModel, terms: Sequence[type[DiscrepancyTerm]], least: float
) -> list[Start]:
    """Return those of the `terms` that gain at `least` that by a linearisation beside `root`, the best first.

    Terms of many parameters are left out: their initial values are a matter of regression.
    """
    starts = []
    for term in terms:
        values = candidate(term).starts
        if issubclass(term, ByLoggedColumn):
            starts += _by_logged_column(extended, root, term)
        elif len(values) <= _MAX_STARTS:
            starts.append(Start(term, values, extended.predicted_gain(root, term.name)))
    return sorted((start for start in starts if start.gain > least), key=lambda start: -start.gain)


def _by_logged_column(extended: Selector, root: ScoredModel, term: type[ByLoggedColumn]) -> list[Start]:
    """Return the term of the logged column that is predicted to gain most, if there is one.

    The term is linear: a small change says as much as a large one. The order of runs stands for campaign time.
    """
    regressors = extended.batch.readings.logged.regressors
    kind = candidate(term)
    starts = []
    for column in (k for k, regressor in enumerate(regressors) if regressor.column != RUN_ORDER):
        values = np.where([p.is_discrete for p in term.parameters()], float(column), _SMALL * kind.scale)[None, :]
        gain = extended.predicted_gain(root, term.name, replace(kind, starts=values))
        starts.append(Start(term, values, gain))
    return sorted(starts, key=lambda start: -start.gain)[:1]


def terms_without_regression(extended: Selector) -> list[type[DiscrepancyTerm]]:
    """Return the terms that this vehicle can have, without those of logged columns: the regression tries each."""
    return [term for term in TERMS if not issubclass(term, ByLoggedColumn) and applies(term, extended.batch.geometry)]


def best_term(
    extended: Selector, root: ScoredModel, starts: list[Start]
) -> tuple[ScoredModel, type[DiscrepancyTerm]] | None:
    """Return the best model with a term beside `root`, and the term; None if no term meets the criterion."""
    best: tuple[ScoredModel, type[DiscrepancyTerm]] | None = None
    for start in starts:
        kind = candidate(start.term)
        values = np.clip(start.values, kind.bounds[:, 0], kind.bounds[:, 1])
        screened = replace(kind, starts=values, screened=True, patient=start is starts[0], expected_gain=start.gain)
        model = extended.with_effect(root, start.term.name, screened)
        if is_constant_change(model, start.term) or _is_outside_the_room(model, start.term):
            continue
        if extended.meets_criterion(root, model) and (best is None or model.deviance < best[0].deviance):
            best = model, start.term
    return best


def is_constant_change(model: ScoredModel, term: type[DiscrepancyTerm]) -> bool:
    """Return whether a term of campaign time was fitted to a change that is none."""
    if not issubclass(term, ByCampaignTime) or not model.is_fitted:
        return False
    return is_constant(model.values_of(term.name), model.fit.predictor.readings.started_h)


def _is_outside_the_room(model: ScoredModel, term: type[DiscrepancyTerm]) -> bool:
    """Return whether a term of a place was fitted to one at a bound: it stands for a direction on the floor."""
    return model.is_fitted and not _COORDINATES.isdisjoint(model.parameters_at_bound(term.name))
