"""Other equations of effects that fit much better but predict worse.

An effect with the wrong equation may reduce the error of the runs that it is fitted to, and predict others worse: its
parameters differ from run to run. The selection refuses it, and would never come to its variants.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import FIT
from agvbench.diagnosis.selection.candidates import candidate
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import select_further, simulated_variants, starts_near, with_extended_library
from agvbench.effects.variants import cause_of


def with_refused_effects(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with a variant of an effect that cross-validation refused, and what is needed beside it.

    The selection is returned as it is if no variant of such an effect meets the selection criterion.
    """
    current = selection.chosen
    has_variant = any(cause_of(name) != name for name in current.names)
    refused = list(_refused(current, with_extended_library(selector) if has_variant else selector))
    if not refused:
        return selection
    extended = with_extended_library(selector)
    models = [model for one in refused for model in _with_variants(extended, current, one)]
    accepted = [model for model in models if extended.improves(current, model)]
    if not accepted:
        return selection
    best = extended.preferred(accepted)
    selector.on_progress(f"{' + '.join(best.names)}: a variant gains {current.deviance - best.deviance:.0f}")
    return select_further(selection, best, selector)


def _refused(current: ScoredModel, selector: Selector) -> Iterator[ScoredModel]:
    """Yield `current` with each further effect that clearly gains in the fit, and not in cross-validation."""
    for name in selector.further(current):
        if selector.predicted_gain(current, name) > FIT.large_predicted_gain:
            model = selector.with_effect(current, name)
            gain = model.fit_gain_over(current)
            if gain > FIT.large_predicted_gain and model.gain_over(current) < selector.min_gain:
                yield model


def _with_variants(extended: Selector, current: ScoredModel, refused: ScoredModel) -> Iterator[ScoredModel]:
    """Yield `current` with each variant of the last effect of a model, fitted from near the library's equation."""
    (name,) = {*refused.names} - {*current.names}
    for variant in simulated_variants(extended.batch):
        if variant.variant_of == name:
            near = replace(candidate(variant), starts=starts_near(variant, refused))
            with suppress(np.linalg.LinAlgError):  # the fit diverged
                model = extended.with_effect(current, variant.name, near)
                if model.is_fitted:
                    yield model
