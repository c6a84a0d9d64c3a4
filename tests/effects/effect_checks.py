"""Checks of form that every effect's class passes, and a template too."""

from __future__ import annotations

import inspect
import math

import numpy as np

from agvbench.effects import HOOKS, TIME_HOOKS, Effect, Stage
from agvbench.effects import state as s


def check_form(cls: type[Effect]) -> None:
    """Declarations are complete, and hooks have the form that the simulation composes."""
    assert isinstance(cls.stage, Stage)
    for text in (cls.relaxes, cls.reference, cls.limits, cls.__doc__):
        assert text
    assert cls.parameters()
    for p in cls.parameters():
        assert p.low < p.high
        assert p.low <= p.scale <= p.high
        assert math.isinf(p.null) or p.low <= p.null <= p.high
    assert cls.hooks()
    for name, hook in cls.hooks().items():
        assert cls.stage in HOOKS[name]
        assert isinstance(inspect.getattr_static(cls, name), staticmethod)
        wanted = ["state", *(["time_s"] if name in TIME_HOOKS else []), *(p.name for p in cls.parameters())]
        assert list(inspect.signature(hook).parameters) == wanted
        assert hook.__doc__


def check_null_hooks(cls: type[Effect]) -> None:
    """Called as plain Python at null, hooks leave the state as it is."""
    null = cls().values.values()
    state = np.random.default_rng(7).uniform(-1.0, 1.0, s.SIZE)
    state[[s.STEERING_LAG, s.FRONT_BACKLASH, s.REAR_BACKLASH, s.ACCELERATE_LAG, s.BRAKE_LAG]] = 0.0
    state[[s.STEERING_INERTIA, s.DRIVE_INERTIA, s.REAR_WAIT, s.DRIVE_WAIT, s.DRIVE_BACKLASH, s.SEEN_LAG]] = 0.0
    state[[s.STEERING_RATE, s.STEERING_ACCELERATION, s.ACCELERATION_LIMIT, s.BRAKING_LIMIT]] = math.inf
    state[[s.BODY_ACCELERATION_LIMIT, s.BODY_BRAKING_LIMIT]] = math.inf
    for name, hook in cls.hooks().items():
        before = state.copy()
        if name in TIME_HOOKS:
            assert hook(state, 1.25, *null) == 1.25
        else:
            hook(state, *null)
        np.testing.assert_array_equal(state, before)
