"""Delays of the camera and of each actuator: a model of all actuators in place of an effect that resembles several.

Servos and drive follow a command late, each in its own way. A latency of the camera with a filter resembles all of them
at once, so that a selection of one effect at a time takes the filter. It is a claim about a documented instrument, and
is kept only if the actuators do not explain the runs as well. A delay of the servos likewise resembles their lag.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import DISCREPANCY, SELECTION
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_structure
from agvbench.diagnosis.selection.stepwise import AnySelector, Selection, Selector
from agvbench.diagnosis.selection.variants import add_variants, variant_candidates, with_extended_library
from agvbench.effects.variants import cause_of

CAMERA, DELAY = "mocap_latency", "actuation_delay"
ACTUATORS = ("actuation_delay", "steering_lag", "speed_lag", "wheel_lag")
SERVOS = ("actuation_delay", "steering_lag", "steering_rate_limit")
MOTORS = (*SERVOS, "yaw_acceleration_limit", "speed_lag", "wheel_lag")
SERVOS_DELAY = "actuation_delay_servos"
_EVEN, _UNEVEN = "steering_lag_inertia", "steering_lag_uneven"
_LAG, _SPEED, _WHEELS = "steering_lag", "speed_lag", "wheel_lag"
_SPEED_INERT, _WHEELS_INERT = "speed_lag_inertia", "wheel_lag_inertia"
# Of a response of second order with critical damping: its inertia over its lag.
_CRITICAL = 0.5
_LEAST_LAG_S = 0.02


def separate_lag_from_delay(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with a common delay and a lag of the servos, if they explain a slow response better.

    A selection of one effect at a time takes what resembles the whole response, and neither a delay of each servo nor a
    rate limit leaves a gain to the other causes. If both descriptions predict equally, the lag becomes an alternative.
    A delay also resembles lags of servos and drive that are about equal.
    """
    chosen, which = selection.chosen, MOTORS if selector.batch.geometry.is_differential else SERVOS
    slow = [name for name in chosen.names if cause_of(name) in which and name not in selector.given]
    if _SPEED not in {cause_of(name) for name in (*chosen.names, *selector.given)}:
        which = (*which, _SPEED)
    if not slow or {*which} & selector.given_causes:
        return selection
    extended = with_extended_library(selector)
    separate = _with_lag_and_delay(extended, chosen, slow)
    if separate is None or {*separate.names} == {*chosen.names}:
        return selection
    difference = separate.deviance - chosen.deviance
    gains_clearly = difference < -selector.min_gain * max(len(separate.names) - len(chosen.names), 1)
    if gains_clearly:
        replaced = _replaced(selection, selector, extended, separate, which)
        if {*replaced.chosen.names} != {*chosen.names}:
            return replaced
    if difference > SELECTION.alternative_margin:
        return selection
    present = {cause_of(name) for name in chosen.names}
    absent = [name for name in separate.names if cause_of(name) in which and cause_of(name) not in present]
    # A gain that rests on few runs selects no lag, but leaves it possible.
    others = {
        cause_of(name): difference
        for name in absent
        if gains_clearly
        or extended.meets_criterion(extended.without_effect(selection.base, separate, name), separate, of_group=True)
    }
    alternatives = {name: selection.alternatives.get(name, {}) | others for name in slow}
    return replace(selection, alternatives=selection.alternatives | alternatives)


def separate_channels(selection: Selection, selector: AnySelector) -> tuple[Selection, AnySelector]:
    """Return the selection with a delay of each channel and a lag of each, if they predict better, and its selector.

    While a vehicle drives, speed and steering answer at times of their own. One delay of all commands, or of the
    camera, resembles the slower of them, and the lag of the other leaves no gain beside it.
    """
    chosen = selection.chosen
    slow = [name for name in chosen.names if cause_of(name) in (CAMERA, *MOTORS) and name not in selector.given]
    has_common_delay = {CAMERA, DELAY} & {cause_of(name) for name in slow}
    if not has_common_delay or {*MOTORS} & selector.given_causes:
        return selection, selector
    extended = with_extended_library(selector)
    model = _with_channels(extended, chosen, slow)
    if model is None or model.gain_over(chosen) < SELECTION.min_gain:
        return selection, selector
    separate = _replaced(selection, extended, extended, model, ACTUATORS)
    more = len(separate.chosen.names) - len(chosen.names)
    gains = separate.chosen.gain_over(chosen) > SELECTION.min_gain * max(more, 1)
    return (separate, extended) if gains else (selection, selector)


def _with_channels(extended: Selector, chosen: ScoredModel, slow: list[str]) -> ScoredModel | None:
    """Return the model with delays and lags of the channels in place of the effects `slow`; None if it diverges.

    The response of the steering is first taken for a delay beside its lag, and then for a lag alone.
    """
    own = chosen.fit.effect_values()
    response, _, drive = _responses_s(own, slow)
    values = {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] in slow}
    lag, up, down = (
        max(values.get(name, 0.0), _LEAST_LAG_S) for name in ("time_constant_s", "accelerate_s", "brake_s")
    )
    kept = [value for key, value in own.items() if key.partition(".")[0] not in slow]
    names = (*(name for name in chosen.names if name not in slow), SERVOS_DELAY, _LAG, _SPEED)
    maps = chosen.fit.parameters[: extended.batch.maps.size]
    models = []
    for delay, time_constant in ((max(response - lag, 0.0), lag), (0.0, max(response, _LEAST_LAG_S))):
        start = np.r_[maps, kept, delay, drive, time_constant, up, down]
        starts = frozenset(one for one in chosen.starts if one[0] not in slow) | {("channels", start.tobytes())}
        with suppress(np.linalg.LinAlgError):  # the fit diverged
            models.append(extended.score(names, start, chosen.fit, starts=starts))
    return min(models, key=lambda model: model.deviance, default=None)


def _with_lag_and_delay(extended: Selector, chosen: ScoredModel, slow: list[str]) -> ScoredModel | None:
    """Return the model with a delay and lags in place of the effects `slow`; None if it diverges.

    Of several descriptions, a longer one is preferred if it gains.
    """
    own = chosen.fit.effect_values()
    kept = [value for key, value in own.items() if key.partition(".")[0] not in slow]
    others = tuple(name for name in chosen.names if name not in slow)
    maps = chosen.fit.parameters[: extended.batch.maps.size]
    has_speed_lag = _SPEED in map(cause_of, others)
    responses = (
        _motors(own, slow)
        if extended.batch.geometry.is_differential
        else _servos(own, slow, has_speed_lag=has_speed_lag)
    )
    best: ScoredModel | None = None
    for names, values in responses.items():
        start = np.r_[maps, kept, values]
        starts = frozenset(one for one in chosen.starts if one[0] not in slow) | {("lag and delay", start.tobytes())}
        with suppress(np.linalg.LinAlgError):  # the fit diverged
            model = extended.score((*others, *names), start, chosen.fit, starts=starts)
            best = model if best is None or model.deviance <= best.deviance - extended.min_gain else best
    return best


def _servos(own: Mapping[str, float], slow: list[str], *, has_speed_lag: bool) -> dict[tuple[str, ...], list[float]]:
    """Return effects with initial values: one lag of both servos, or a lag each where one is slower than the other.

    Where the drive responds late, too, its response is also taken for a lag, unless the model has one.
    """
    front, rear, drive = _responses_s(own, slow)
    delay = min(drive, front, rear)
    lags = max(front - delay, _LEAST_LAG_S), max(rear - delay, _LEAST_LAG_S)
    mean = 0.5 * sum(lags)
    late: dict[tuple[str, ...], list[float]] = {}
    if drive > 0.0 and not has_speed_lag:
        late[_LAG, _SPEED] = [0.5 * (front + rear), drive, drive]
    return late | {
        (DELAY, _EVEN): [delay, mean, _CRITICAL * mean],
        (DELAY, _UNEVEN): [delay, lags[0], _CRITICAL * lags[0], lags[1] / lags[0]],
    }


def _motors(own: Mapping[str, float], slow: list[str]) -> dict[tuple[str, ...], list[float]]:
    """Return effects with initial values: the motors of a differential vehicle, which set speed and yaw rate.

    Where both start at once, a delay resembles the lags of both, and neither lag alone describes them: half of the
    response is taken for a delay. The wheels have one lag, or speed and yaw rate have one each, of either order: a
    controller of second order begins like a delay.
    """
    yaw, _, drive = _responses_s(own, slow)
    values = {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] in slow}
    drive += 0.5 * (values.get("accelerate_s", 0.0) + values.get("brake_s", 0.0))
    delay = 0.5 * min(yaw, drive)
    lags = max(yaw - delay, _LEAST_LAG_S), max(drive - delay, _LEAST_LAG_S)
    mean = 0.5 * sum(lags)
    inert = [[lag, _CRITICAL * lag] for lag in (mean, *lags)]
    return {
        (DELAY, _WHEELS): [delay, mean],
        (DELAY, _WHEELS_INERT): [delay, *inert[0]],
        (DELAY, _LAG, _SPEED): [delay, lags[0], lags[1], lags[1]],
        (DELAY, _EVEN, _SPEED_INERT): [delay, *inert[1], *inert[2]],
    }


def _responses_s(own: Mapping[str, float], slow: list[str]) -> tuple[float, float, float]:
    """Return the time after which front servo, rear servo and drive respond, by the effects `slow` [s]."""
    values = {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] in slow}
    common, lag = values.get("delay_s", values.get("latency_s", 0.0)), values.get("time_constant_s", 0.0)
    steering = values.get("steering_s", common)
    rear_lag = lag * values.get("rear_ratio", 1.0)
    return (
        values.get("front_s", steering) + lag,
        values.get("rear_s", steering) + rear_lag,
        values.get("drive_s", common),
    )


def _replaced(
    selection: Selection, selector: Selector, extended: Selector, model: ScoredModel, which: tuple[str, ...]
) -> Selection:
    """Return the selection with `model` in place of the chosen one, less the effects that it does not need."""
    current, gains = extended.backward_elimination(selection.base, model, which)
    gain = selection.chosen.deviance - current.deviance
    if gain > 0.0:
        selector.on_progress(f"{' + '.join(current.names)}: lag and delay separately gain {gain:.0f}")
    causes = {cause_of(name) for name in current.names}
    add_variants(selector, current.names)
    return replace(
        selection,
        chosen=current,
        alternatives={
            name: {other: more for other, more in selection.alternatives.get(name, {}).items() if other not in causes}
            for name in gains
        },
        gains=gains,
        rejected={name: gain for name, gain in selection.rejected.items() if name not in causes},
        tried=selector.models_fitted,
    )


def prefer_actuators(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with actuators in place of a latency of the camera, if they predict about as well.

    If the residuals show structure, both models are wrong, and a likelihood ratio does not discriminate them: the
    actuators are preferred if they keep most of the gain. The latency is then an alternative of each actuator that
    replaced it.
    """
    chosen = selection.chosen
    camera = next((n for n in chosen.names if cause_of(n) == CAMERA and n not in selector.given), None)
    if camera is None:
        return selection
    extended = with_extended_library(selector)
    without = extended.without_effect(selection.base, chosen, camera)
    every = _with_actuators(extended, without)
    if selector.batch.geometry.is_differential and not {*MOTORS} & selector.given_causes:
        # The camera resembles the lags of both motors together, and none of them alone.
        slow = [name for name in chosen.names if cause_of(name) in (CAMERA, *MOTORS) and name not in selector.given]
        joint = _with_lag_and_delay(extended, chosen, slow)
        every = min((model for model in (every, joint) if model is not None), key=lambda model: model.deviance)
    difference, gain = every.deviance - chosen.deviance, without.deviance - chosen.deviance
    margin = SELECTION.alternative_margin
    if difference > (max(margin, SELECTION.camera_share * gain) if has_structure(chosen, selector.seed) else margin):
        return selection
    current, gains = extended.backward_elimination(selection.base, every, ACTUATORS)
    selector.on_progress(f"{' + '.join(current.names)}: actuators in place of {CAMERA} gain {-difference:.0f}")
    causes = {cause_of(name) for name in current.names} | {CAMERA}
    alternatives = {
        name: {other: more for other, more in selection.alternatives.get(name, {}).items() if other not in causes}
        for name in gains
    }
    for name in gains:
        if difference > -margin and name not in chosen.names and cause_of(name) in ACTUATORS:
            alternatives[name][CAMERA] = -difference
    add_variants(selector, current.names)
    rejected = {name: gain for name, gain in selection.rejected.items() if name not in causes}
    return replace(
        selection,
        chosen=current,
        alternatives=alternatives,
        gains=gains,
        rejected=rejected,
        tried=selector.models_fitted,
    )


def _with_actuators(extended: Selector, current: ScoredModel) -> ScoredModel:
    """Return the model with every actuator, and with the effects that meet the criterion beside them."""
    for name in ACTUATORS:
        if name in extended.candidates and name not in {cause_of(present) for present in current.names}:
            larger = extended.with_effect(current, name)
            current = larger if larger.is_fitted else current
    while True:
        causes = {cause_of(name) for name in current.names} | {CAMERA}
        names = [name for name in extended.candidates if name not in causes and name not in variant_candidates()]
        predicted = {name: extended.predicted_gain(current, name) for name in names}
        best = sorted(predicted, key=lambda name: -predicted[name])[: DISCREPANCY.max_refitted]
        models = [extended.with_effect(current, name) for name in best if predicted[name] > extended.min_gain]
        accepted = [model for model in models if extended.meets_criterion(current, model)]
        if not accepted:
            return current
        current = min(accepted, key=lambda model: model.deviance)
