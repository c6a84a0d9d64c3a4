"""The best step of a quadratic approximation within bounds."""

from __future__ import annotations

import numpy as np

from agvbench.types import Floats


def bounded_step(matrix: Floats, gradient: Floats, parameters: Floats, bounds: Floats) -> Floats:
    """Return the step (P,) of the normal equations from `parameters` (P,), the last q of which have `bounds` (q, 2).

    A parameter that would leave its bounds moves to the bound, and the others are solved for beside it. If it were only
    clipped, the others would compensate for a move that is not made, and no fraction of the step might reduce the
    objective. Which parameters are held follows from the step and its multipliers (primal-dual active set strategy:
    Hintermüller, Ito and Kunisch, SIAM Journal on Optimization 13, 2003).

    Raises
    ------
    numpy.linalg.LinAlgError
        If no step is finite.
    """
    first = len(parameters) - len(bounds)
    low, high = bounds.T - parameters[first:]
    move, held = np.zeros(len(parameters)), np.zeros(len(parameters), dtype=np.bool_)
    for _ in range(2 * len(bounds) + 2):
        rest = gradient - matrix @ np.where(held, move, 0.0)
        move[~held] = np.linalg.lstsq(matrix[np.ix_(~held, ~held)], rest[~held], rcond=1e-12)[0]
        pressing = (gradient - matrix @ move)[first:]
        own, was = move[first:], held[first:]
        below = np.where(was, (own <= low) & (pressing < 0.0), own < low)
        above = np.where(was, (own >= high) & (pressing > 0.0), own > high)
        if np.array_equal(below | above, was):
            break
        held[first:] = below | above
        own[below], own[above] = low[below], high[above]
    if not np.isfinite(move).all():
        raise np.linalg.LinAlgError("no step is finite")
    return move
