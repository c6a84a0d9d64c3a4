"""What predicts the validation runs worse than the maps alone is not named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.batch import Batch
from agvbench.diagnosis.explained import Explained
from agvbench.diagnosis.fitted_models import Scored
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.reading import Readings
from agvbench.diagnosis.residuals import misses
from agvbench.diagnosis.selection import Selection


def withdrawn(
    selection: Selection, explained: Explained | None, kept: Readings, tell: Callable[[str], None]
) -> tuple[Selection, Explained | None]:
    """Return what was found, or the maps alone where they predict the validation runs better.

    Cross-validation asks the runs that were fitted, and may be led astray by all of them together. A cause at work
    improves what nobody looked at, too.

    Parameters
    ----------
    selection, explained
        What was found.
    kept
        The validation runs; without any, what was found is kept.
    tell
        Called with a line if it is withdrawn.
    """
    chosen = explained.selection.chosen if explained else selection.chosen
    if chosen.names == selection.base.names or not len(kept):
        return selection, explained
    fitted = chosen.fit.predictor.batch
    batch = Batch(kept, fitted.maps, fitted.geometry, kinds=fitted.kinds)
    if _missed(chosen, batch) <= _missed(selection.base, batch):
        return selection, explained
    tell(f"{' + '.join(chosen.names)}: withdrawn, for the validation runs are predicted better without")
    rejected = selection.rejected | selection.gains
    return replace(selection, chosen=selection.base, rivals={}, gains={}, rejected=rejected), None


def _missed(model: Scored, batch: Batch) -> float:
    """Return the mean square of the position that a model misses of the runs of `batch` [m²]."""
    poses = Predictor(batch, model.fit.predictor.effects).predict(model.fit.parameters)
    return float(np.mean(misses(batch.readings, poses).squares()["position_rms_mm"]))
