"""A selection with discrepancy terms, and their entries in the diagnosis."""

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
class SelectedTerm:
    """A discrepancy term, and the model ``without`` it.

    ``gain`` is that of the term, in cross-validated minus two log likelihood. ``p_value`` is that of such a gain under
    random signs of the gains of groups. Parameters are those of the model that is `chosen`, which may be refitted.
    """

    term: type[DiscrepancyTerm]
    without: ScoredModel
    gain: float
    p_value: float

    @classmethod
    def of(cls, term: type[DiscrepancyTerm], chosen: ScoredModel, without: ScoredModel, seed: int) -> SelectedTerm:
        """Return the term of a model, given the model `without` it."""
        gain = without.loss - chosen.loss
        group = chosen.fit.predictor.readings.group
        return cls(term, without, float(gain.sum()), gain_p_value(gain, group, seed))

    def values(self, chosen: ScoredModel) -> dict[str, float]:
        """Return the term's parameters by name."""
        own = chosen.fit.effect_values()
        return {p.name: own[f"{self.term.name}.{p.name}"] for p in self.term.parameters()}

    def regressor(self, chosen: ScoredModel) -> Regressor | None:
        """Return the number per run on which a term of a logged column depends; None for other terms."""
        if not issubclass(self.term, ByLoggedColumn):
            return None
        regressors = self.without.fit.predictor.readings.logged.regressors
        return regressors[min(round(self.values(chosen)["column"]), len(regressors) - 1)]

    def covariates(self, chosen: ScoredModel) -> tuple[str, ...]:
        """Return the covariates of the term, the main one first."""
        regressor = self.regressor(chosen)
        return self.term.covariates if regressor is None else (regressor.column,)

    def entry(self, chosen: ScoredModel) -> dict[str, object]:
        """Return the entry of the term in the provenance."""
        return {
            "name": self.term.name,
            "covariate": self.covariates(chosen)[0],
            "through": self.term.through,
            "parameters": self._parameters(chosen),
            "gain": self.gain,
            "p_value": self.p_value,
        }

    def _parameters(self, chosen: ScoredModel) -> dict[str, object]:
        """Return the parameters; for a logged column with its mean and deviation in place of its number."""
        values: dict[str, object] = {**self.values(chosen)}
        if (regressor := self.regressor(chosen)) is not None:
            del values["column"]
            values |= {"mean": regressor.mean, "deviation": regressor.deviation}
            values |= {} if regressor.level is None else {"level": regressor.level[:_LONGEST_LEVEL]}
        return values


@dataclass(frozen=True)
class TermSelection:
    """A selection with discrepancy terms.

    ``selection.chosen`` contains the terms and the selected effects; ``without`` is the model with these effects only.
    ``terms`` are in the order in which they were selected.
    """

    selection: Selection
    terms: tuple[SelectedTerm, ...]
    without: ScoredModel

    @property
    def names(self) -> str:
        """The names of the terms, as a text."""
        return " and ".join(one.term.name for one in self.terms)

    @property
    def entries(self) -> list[dict[str, object]]:
        """The entries of the terms in the provenance, with the parameters of the chosen model."""
        return [one.entry(self.selection.chosen) for one in self.terms]


def with_terms_first(rest: list[Dependence], term_selection: TermSelection) -> list[Dependence]:
    """Return the dependences, with those of the terms first."""
    for selected in reversed(term_selection.terms):
        rest = _with_term_first(rest, selected, term_selection.selection.chosen)
    return rest


def _with_term_first(rest: list[Dependence], selected: SelectedTerm, chosen: ScoredModel) -> list[Dependence]:
    """Return the dependences, with that of a term first.

    If a term has several covariates (x and y), the dependence is that with the larger share in the covariate test.
    """
    covariates = selected.covariates(chosen)
    own = [d for d in rest if d.covariate in covariates]
    if own:
        first = replace(own[0], p_value=min(own[0].p_value, selected.p_value))
        return [first, *(d for d in rest if d is not own[0])]
    with_term, without = (_sum_of_squares(model) for model in (chosen, selected.without))
    share = 1.0 - with_term / max(without, 1e-300)
    return [Dependence(covariates[0], selected.term.through, selected.p_value, share), *rest]


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
