"""The axle that stands still, held out: a constant, a lever arm and a coupling, within a table and across the two."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from agvbench.types import Floats
from agvbench.workflows.thesis.lever_arm import IDLE, idle, slope_and_error
from agvbench.workflows.thesis.tables import rms


@cache
def idle_errors() -> dict[str, tuple[Floats, Floats, Floats, Floats]]:
    """Return, per idle axle, held-out errors [deg]: of a constant, of a lever arm, of coupling; then the angle turned.

    Each pulse is predicted from the others. The lever arm's own offset of the axle is fitted beside it.
    """
    found = {}
    for axle in IDLE:
        part = idle(axle)
        every = np.arange(len(part.tangent))
        angle = np.arctan(part.tangent)
        rows = []
        for k in every[1:-1]:
            own = every != k
            constant = angle[own].mean()
            arm, _, _ = slope_and_error(part.curvature_per_m[own], part.tangent[own])
            level = part.tangent[own].mean() - arm * part.curvature_per_m[own].mean()
            lever = math.atan(level + arm * part.curvature_per_m[k])
            share, _, _ = slope_and_error(part.other_rad[own], angle[own])
            coupled = angle[own].mean() + share * (part.other_rad[k] - part.other_rad[own].mean())
            rows.append(np.degrees(angle[k] - np.array([constant, lever, coupled])))
        errors = np.array(rows).T
        found[axle] = errors[0], errors[1], errors[2], np.degrees(part.other_rad[1:-1])
    return found


def arm_across_tables() -> dict[str, tuple[float, float, float]]:
    """Return, per table, rms [deg] of its idle axle: about its mean, with the other table's arm, and its coupling.

    Only the axle's own mean is fitted to the table that is predicted. The coupling is carried over as it is.
    """
    parts = {axle: idle(axle) for axle in IDLE}
    out = {}
    for axle, other in zip(IDLE, reversed(IDLE), strict=True):
        own, known = parts[axle], parts[other]
        arm, _, _ = slope_and_error(known.curvature_per_m, known.tangent)
        share, _, _ = slope_and_error(known.other_rad, np.arctan(known.tangent))
        angle = np.arctan(own.tangent)
        lever = own.tangent - arm * own.curvature_per_m
        coupled = angle - share * own.other_rad
        out[axle] = (
            math.degrees(rms(angle - angle.mean())),
            math.degrees(rms(lever - lever.mean())),
            math.degrees(rms(coupled - coupled.mean())),
        )
    return out
