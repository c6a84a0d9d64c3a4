"""Lack of fit of a model in the training runs, while effects are selected."""

from __future__ import annotations

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.residuals.covariate_test import dependences
from agvbench.diagnosis.residuals.repeatability import repeatability
from agvbench.diagnosis.residuals.residuals import lack_of_fit, pose_residuals
from agvbench.diagnosis.selection.fitted_models import ScoredModel


def has_lack_of_fit(model: ScoredModel) -> bool:
    """Return whether the residuals exceed the repeatability, and differ significantly between groups of repeats."""
    readings = model.fit.predictor.readings
    residuals = pose_residuals(readings, model.fit.predictor.predict(model.fit.parameters))
    least = repeatability(residuals, readings.session_group, readings.started_h)
    p_value = lack_of_fit(residuals, readings.group)
    if least is None or p_value is None or p_value >= RESIDUAL.lack_of_fit_alpha:
        return False
    return residuals.exceed(least, RESIDUAL.within_repeatability)


def has_structure(model: ScoredModel, seed: int) -> bool:
    """Return whether the residuals in the training runs show lack of fit, or depend on a covariate."""
    if has_lack_of_fit(model):
        return True
    readings = model.fit.predictor.readings
    rates = residual_rates(readings, model.fit.predictor.predict(model.fit.parameters))
    return bool(dependences(rates, readings.group, seed, readings.start))


def may_have_structure(model: ScoredModel, seed: int) -> bool:
    """Return whether the residuals in the training runs show lack of fit or a dependence, at the likely level."""
    readings = model.fit.predictor.readings
    poses = model.fit.predictor.predict(model.fit.parameters)
    p_value = lack_of_fit(pose_residuals(readings, poses), readings.group)
    if p_value is not None and p_value < RESIDUAL.likely_alpha:
        return True
    rates = residual_rates(readings, poses)
    return bool(dependences(rates, readings.group, seed, readings.start, alpha=RESIDUAL.likely_alpha))
