"""A selection with a discrepancy term, and its entries in the diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.logged import Regressor
from agvbench.diagnosis.estimation.cross_validation import by_group
from agvbench.diagnosis.estimation.likelihood import residual_of
from agvbench.diagnosis.residuals.covariate_test import Dependence
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.terms import ByLoggedColumn, DiscrepancyTerm
from agvbench.types import Floats

_FLIPS, _LONGEST_LEVEL = 9999, 40


@dataclass(frozen=True)
class TermSelection:
    """A selection with a discrepancy term.

    ``selection.chosen`` contains the term and the selected effects; ``without`` is the model with these effects only.
    ``gain`` is that of the term, in cross-validated minus two log likelihood. ``p_value`` is that of such a gain under
    random signs of the gains of groups.
    """

    selection: Selection
    term: type[DiscrepancyTerm]
    without: ScoredModel
    gain: float
    p_value: float

    @property
    def values(self) -> dict[str, float]:
        """The term's parameters by name."""
        own = self.selection.chosen.fit.effect_values()
        return {p.name: own[f"{self.term.name}.{p.name}"] for p in self.term.parameters()}

    @property
    def regressor(self) -> Regressor | None:
        """The number per run on which a term of a logged column depends; None for other terms."""
        if not issubclass(self.term, ByLoggedColumn):
            return None
        regressors = self.without.fit.predictor.readings.logged.regressors
        return regressors[min(round(self.values["column"]), len(regressors) - 1)]

    @property
    def covariates(self) -> tuple[str, ...]:
        """The covariates of the term, the main one first."""
        return self.term.covariates if self.regressor is None else (self.regressor.column,)


def term_entry(term_selection: TermSelection) -> dict[str, object]:
    """Return the entry of a discrepancy term in the provenance."""
    return {
        "name": term_selection.term.name,
        "covariate": term_selection.covariates[0],
        "through": term_selection.term.through,
        "parameters": _parameters(term_selection),
        "gain": term_selection.gain,
        "p_value": term_selection.p_value,
    }


def _parameters(term_selection: TermSelection) -> dict[str, object]:
    """Return the parameters of a term; for a logged column with its mean and deviation in place of its number."""
    values: dict[str, object] = {**term_selection.values}
    if (regressor := term_selection.regressor) is not None:
        del values["column"]
        values |= {"mean": regressor.mean, "deviation": regressor.deviation}
        values |= {} if regressor.level is None else {"level": regressor.level[:_LONGEST_LEVEL]}
    return values


def with_term_first(rest: list[Dependence], term_selection: TermSelection) -> list[Dependence]:
    """Return the dependences, with that of the term first.

    If a term has several covariates (x and y), the dependence is that with the larger share in the covariate test.
    """
    own = [d for d in rest if d.covariate in term_selection.covariates]
    if own:
        first = replace(own[0], p_value=min(own[0].p_value, term_selection.p_value))
        return [first, *(d for d in rest if d is not own[0])]
    with_term, without = (_sum_of_squares(model) for model in (term_selection.selection.chosen, term_selection.without))
    share = 1.0 - with_term / max(without, 1e-300)
    return [
        Dependence(term_selection.covariates[0], term_selection.term.through, term_selection.p_value, share),
        *rest,
    ]


def _sum_of_squares(model: ScoredModel) -> float:
    """Return the sum of squares of a model's residuals, with random effects of zero."""
    predictor = model.fit.predictor
    return float(np.nansum(residual_of(predictor, predictor.predict(model.fit.parameters)) ** 2))


def gain_p_value(gain: Floats, group: NDArray[np.int64], seed: int) -> float:
    """Return the p-value of the total gain under random signs of the groups' gains; `gain` (R,) is by run."""
    gains = by_group(gain, group)
    rng = np.random.default_rng([0xF119, seed])
    signs = rng.integers(0, 2, (_FLIPS, len(gains))) * 2.0 - 1.0
    return float((1.0 + np.count_nonzero(signs @ gains >= gains.sum())) / (_FLIPS + 1.0))
