"""Uncertainty budgets of end pose errors: per trajectory and condition, of the mean over repeats.

The results are the mean end position error [mm] and the mean signed heading error [deg]. Noise of the camera at the
rest poses differs from run to run: the scatter of repeats contains it, so it is shown and not added; only by how much
it enlarges distances is added. What is the same in every run shows in no repeat: it enters as far as the lab states it
(`agvbench.campaign.uncertainty_statement`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from agvbench.campaign.uncertainty_statement import Evaluation
from agvbench.statistics.quantities import HEADING, POSITION, Quantity
from agvbench.statistics.uncertainty.budget import REPEATS, Budget, Component, Role
from agvbench.statistics.uncertainty.propagation import (
    CLOCK,
    SOURCES,
    enlargement_by_noise,
    heading_contribution,
    position_contribution,
)
from agvbench.statistics.uncertainty.repeats import At, Repeats, RestPoses, mean_square_root, rest_poses
from agvbench.types import Floats, Run

SIGNED_HEADING = replace(HEADING, name="heading error, signed")
_ONE_RUN = "one repeat: drive more (bench --repeats)"
_FEW_FRAMES = "too few frames at rest: raise the frame rate"
_STATED = "stated"
_BY_DELAY = "limits ± longest delay of frames, times the speed at rest; lacks a constant latency before the stamp"
_AT: tuple[At, At] = ("start", "end")
_Contribution = Callable[[Repeats, str, float], float]


@dataclass(frozen=True)
class EndPoseBudget:
    """The budget of one quantity on one trajectory under one condition, from `repeats` runs."""

    trajectory: str
    condition: str
    quantity: Quantity
    repeats: int
    budget: Budget

    @property
    def interval(self) -> tuple[float, float]:
        """The mean ± U; a distance is not negative, so its interval ends at zero. NaN without repeats."""
        low, high = (self.budget.estimate + sign * self.budget.expanded for sign in (-1.0, 1.0))
        return (0.0 if self.quantity is POSITION and low < 0.0 else low), high


def end_pose_budgets(runs: Iterable[Run], stated: Mapping[str, Evaluation] | None = None) -> list[EndPoseBudget]:
    """Return two budgets for each trajectory and condition, in the order of their first runs.

    Parameters
    ----------
    runs
        Those that do not count, or have no target or no rest pose, are left out.
    stated
        Type B evaluations by key of `SOURCES`.
    """
    return budgets_of([one for run in runs if run.is_ok and run.target.is_finite for one in rest_poses(run)], stated)


def budgets_of(measured: list[RestPoses], stated: Mapping[str, Evaluation] | None = None) -> list[EndPoseBudget]:
    """Return what `end_pose_budgets` does, from rest poses."""
    first = {key: at for at, key in reversed(list(enumerate(one.key for one in measured)))}
    found = []
    for (trajectory, condition), group in groupby(
        sorted(measured, key=lambda one: first[one.key]), lambda one: one.key
    ):
        repeats = Repeats(list(group))
        for quantity, budget in ((POSITION, _position), (SIGNED_HEADING, _heading)):
            found.append(EndPoseBudget(trajectory, condition, quantity, len(repeats), budget(repeats, stated or {})))
    return found


def key_to_state(component: Component) -> str | None:
    """Return the key of ``[uncertainty]`` by which a lab adds a component that is not stated; None for others."""
    is_open = component.role is Role.NOT_STATED and math.isfinite(component.sensitivity)
    return _KEY_OF.get(component.source) if is_open else None


_KEY_OF = {source: key for key, (source, _) in SOURCES.items()}


def _position(repeats: Repeats, stated: Mapping[str, Evaluation]) -> Budget:
    components = [_of_repeats(repeats, repeats.distance, "mm")]
    for at in _AT:
        errors = 1e3 * repeats.column(at, "stderr_position_m")
        components.append(_noise(f"camera noise: {at} position", repeats, errors, "mm", 1.0, at))
    headings = np.degrees(repeats.column("start", "stderr_heading_rad"))
    lever = math.radians(mean_square_root(repeats.across_path))
    components.append(_noise("camera noise: start heading", repeats, headings, "deg", lever, "start"))
    if len(repeats) > 1:
        components.append(_enlargement(repeats))
    systematic = _systematic(repeats, stated, list(SOURCES), position_contribution)
    return Budget(float(repeats.distance.mean()), "mm", [*components, *systematic])


def _heading(repeats: Repeats, stated: Mapping[str, Evaluation]) -> Budget:
    components = [_of_repeats(repeats, repeats.heading, "deg")]
    for at in _AT:
        errors = np.degrees(repeats.column(at, "stderr_heading_rad"))
        components.append(_noise(f"camera noise: {at} heading", repeats, errors, "deg", 1.0, at))
    systematic = _systematic(repeats, stated, ["camera_heading_deg", CLOCK], heading_contribution)
    return Budget(float(repeats.heading.mean()), "deg", [*components, *systematic])


def _of_repeats(repeats: Repeats, values: Floats, unit: str) -> Component:
    """Return the type A component: the standard deviation of the mean of `values`, shape (n,).

    Repeats of one session share what changes between sessions. With two sessions or more the component is computed
    from session means, too, and the one with the wider 95 % interval counts.
    """
    from scipy.special import stdtrit

    n, names = len(values), repeats.sessions
    if n < 2:
        return Component(REPEATS, "A", "t", math.nan, unit, 1.0, math.nan, Role.NOT_STATED, _ONE_RUN)
    single = float(np.std(values, ddof=1)) / math.sqrt(n)
    runs = Component(REPEATS, "A", "t", single, unit, 1.0, n - 1.0, remark=f"mean of {n}")
    if len(names) < 2:
        return runs
    spread = _between([values[repeats.of_session(name)] for name in names])
    remark = f"mean of {n}, from the means of {len(names)} sessions"
    sessions = Component(REPEATS, "A", "t", spread, unit, 1.0, len(names) - 1.0, remark=remark)
    return max(runs, sessions, key=lambda c: c.standard_uncertainty * float(stdtrit(c.degrees_of_freedom, 0.975)))


def _between(groups: Sequence[Floats]) -> float:
    """Return the standard deviation of the mean over all values, from the means of groups of any sizes.

    It is that of the groups' mean if all are of one size; otherwise groups weigh by their size.
    """
    values = np.concatenate(groups)
    sums = [float(np.sum(group - values.mean())) for group in groups]
    return math.hypot(*sums) / len(values) * math.sqrt(len(groups) / (len(groups) - 1.0))


def _noise(source: str, repeats: Repeats, errors: Floats, unit: str, sensitivity: float, at: At) -> Component:
    uncertainty = mean_square_root(errors) / math.sqrt(len(repeats))
    if not math.isfinite(uncertainty):
        return Component(source, "A", "t", math.nan, unit, sensitivity, math.nan, Role.NOT_STATED, _FEW_FRAMES)
    role = Role.IN_REPEATS if len(repeats) > 1 else Role.COMBINED
    freedom = repeats.frames(at)
    return Component(source, "A", "t", uncertainty, unit, sensitivity, freedom, role, "from frames at rest")


def _enlargement(repeats: Repeats) -> Component:
    """Return the component for noise that enlarges distances; the mean is not corrected for it (F.2.4.5)."""
    bias, source = enlargement_by_noise(repeats), "camera noise: enlarges distances"
    if not math.isfinite(bias):
        return Component(source, "B", "", math.nan, "mm", 1.0, math.nan, Role.NOT_STATED, _FEW_FRAMES)
    return Component(source, "B", "bias", abs(bias), "mm", 1.0, math.inf, remark="estimated; the mean is not corrected")


def _systematic(
    repeats: Repeats, stated: Mapping[str, Evaluation], keys: Sequence[str], contribution: _Contribution
) -> Iterator[Component]:
    """Yield what is the same in every run: stated, or from delays, or not stated."""
    for key in keys:
        source, unit = SOURCES[key]
        evaluation, remark = stated.get(key), _STATED
        if evaluation is None and key == CLOCK and repeats.delay_ms > 0.0:
            # A frame is captured before it is received: its time is wrong by no more than its delay.
            evaluation, remark = Evaluation(repeats.delay_ms / math.sqrt(3.0), "rectangular"), _BY_DELAY
        size = 1.0 if evaluation is None else evaluation.standard_uncertainty
        sensitivity = contribution(repeats, key, size) / size
        if evaluation is None or not math.isfinite(sensitivity):
            how = f"state {key} in [uncertainty]" if math.isfinite(sensitivity) else _FEW_FRAMES
            yield Component(source, "B", "", math.nan, unit, sensitivity, math.nan, Role.NOT_STATED, how)
        else:
            freedom = evaluation.degrees_of_freedom
            yield Component(source, "B", evaluation.distribution, size, unit, sensitivity, freedom, remark=remark)
