"""The run to drive next: where alternatives differ most, or where a parameter becomes identifiable.

Indistinguishable alternatives agree on the data at hand. How well a run not driven yet would discriminate them is the
quadratic form of the difference of their predictions in noise and variance components, after the wrong one was fitted
again (the criterion of Box and Hill, 1967, with the parameters' uncertainty). Its unit is that of the losses by which
alternatives are compared. The design that maximises it for the pair that is hardest to discriminate is searched for
among some hundred patterns and then by small changes of the best. A parameter is identified by the design with the
least expected standard error, relative to its scale.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from agvbench.diagnosis.criteria import DESIGN
from agvbench.diagnosis.design.alternatives import Alternative, alternative_models
from agvbench.diagnosis.design.designs import SET_FIRST_S, Design
from agvbench.diagnosis.design.identifiability import Unidentified
from agvbench.diagnosis.design.search import Search
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.proposal import NextExperiment, Proposal
from agvbench.diagnosis.selection.candidates import Candidate
from agvbench.planning import Trajectory, Workspace
from agvbench.planning.trajectories.shapes import CommandTable
from agvbench.types import Floats
from agvbench.vehicle.channels import TableUnit

_REQUIRED_FOR_PAIR: dict[frozenset[str], str] = {
    frozenset({"actuation_delay", "mocap_latency"}): (
        "a time that vehicle and cameras share: a light on the vehicle that its firmware switches with the drive, "
        "an encoder on board that is logged with the commands, or the vehicle pushed by hand with a clap in view"
    ),
    frozenset({"wheel_diameter_mismatch", "marker_offset"}): (
        "the vehicle turned on a jig about a known point, or tight circles both ways, which need a floor that is "
        "large enough"
    ),
    frozenset(
        {"mocap_scale", "wheelbase_error"}
    ): "the wheelbase measured with a tape, or two markers at a known distance",
    frozenset({"mocap_scale", "axle_speed_mismatch"}): "two markers at a known distance, or a tape along a straight",
}
_CLOCK = "a reference beside cameras and commands, such as an encoder on board"
_LENGTH = "two markers at a known distance, measured at several places"
_AXES = "the vehicle's own axis measured on the floor, with a straight edge or by pushing it along a rail"
_REQUIRED_FOR_EFFECT = {
    "mocap_latency": _CLOCK,
    "actuation_delay": _CLOCK,
    "mocap_scale": _LENGTH,
    "heading_misalignment": _AXES,
    "marker_offset": "the markers' centroid measured against the axles, or the vehicle turned on a jig",
}


def required_measurements(names: tuple[str, ...]) -> str:
    """Return, in words, the measurement that would distinguish the effects called `names`.

    >>> required_measurements(("mocap_latency", "actuation_delay")).partition(":")[0]
    'a time that vehicle and cameras share'
    """
    for pair in combinations(names, 2):
        if frozenset(pair) in _REQUIRED_FOR_PAIR:
            return _REQUIRED_FOR_PAIR[frozenset(pair)]
    for name in names:
        if name in _REQUIRED_FOR_EFFECT:
            return _REQUIRED_FOR_EFFECT[name]
    return (
        "a direct measurement of one of them: an angle, a speed or a distance that does not come from the same drives"
    )


_WELL_IDENTIFIED = 0.05
_MAX_IDENTIFIED = 3
_UNKNOWN = 100.0


def discriminate(
    chosen: Fit,
    alternatives: Mapping[str, Mapping[str, float]],
    candidates: Mapping[str, Candidate],
    *,
    unit: TableUnit,
    workspace: Workspace | None = None,
    seed: int = 0,
) -> Proposal:
    """Return the run that discriminates alternatives, and the pairs that no run discriminates.

    Parameters
    ----------
    chosen
        The model with every named effect.
    alternatives
        By named effect, the effects that predict as well in its place, with their difference in deviance.
    candidates
        Candidate effects, by name.
    unit
        Unit of commands.
    workspace
        The floor; by default a circle with a radius of 6.1 m.
    seed
        Seed of the random changes of designs.
    """
    pairs = alternative_models(chosen, alternatives, candidates)
    if not pairs:
        return Proposal()
    search = Search(chosen, workspace or Workspace.circle(), seed)
    if not search.first:
        return Proposal(None, {_names(pair): "a floor on which the vehicle can move" for pair in pairs})
    # Pairs that no design discriminates must not influence the choice for the others.
    table = search.pair_scores(pairs, search.first)
    most = DESIGN.max_repeats * table.max(axis=1)
    inseparable = {
        _names(p): required_measurements(_names(p)) for p, m in zip(pairs, most, strict=True) if m < DESIGN.min_evidence
    }
    separable = [p for p, m in zip(pairs, most, strict=True) if m >= DESIGN.min_evidence]
    if not separable:
        return Proposal(None, inseparable)
    best = search.best(lambda tried: search.pair_scores(separable, tried).min(axis=0))
    each = search.pair_scores(separable, [best])[:, 0]
    repeats = int(
        np.clip(np.ceil(DESIGN.decisive / max(float(each.min()), 1e-9)), DESIGN.min_repeats, DESIGN.max_repeats)
    )
    separations = search.separations(separable, best, each * repeats)
    hardest = min(separations, key=lambda s: s.evidence)
    why = (
        f"distinguishes {' from '.join(hardest.between)}: predictions differ by up to {hardest.apart_mm:.1f} mm and "
        f"{hardest.apart_deg:.2f}° along it; {repeats} repeats should decide (expected {hardest.evidence:.0f}, "
        f"{DESIGN.decisive:.0f} is decisive)"
    )
    names = "_or_".join(dict.fromkeys(name for s in separations for name in s.between))
    trajectory = as_trajectory(best, unit, f"next_{names}"[:60].rstrip("_"), "discriminates alternatives")
    starts = search.starts(best)
    return Proposal(NextExperiment(why, trajectory, repeats, tuple(starts), separations), inseparable)


def identify(
    chosen: Fit,
    flat: Sequence[Unidentified],
    *,
    unit: TableUnit,
    workspace: Workspace | None = None,
    seed: int = 0,
) -> NextExperiment | None:
    """Return the run that identifies most of the parameters that the data do not; None if no run does.

    Parameters with the same influence as a selected one are left out: `discriminate` is for them.

    Parameters
    ----------
    chosen
        The selected model.
    flat
        The parameters that `unidentified` returned.
    unit, workspace, seed
        As for `discriminate`.
    """
    parameters = [item for item in flat if not item.partner][:_MAX_IDENTIFIED]
    if not parameters:
        return None
    search = Search(chosen, workspace or Workspace.circle(), seed)
    if not search.first:
        return None
    least = search.stderr_ratios(parameters, search.first, DESIGN.min_repeats).min(axis=1)
    parameters = [item for item, value in zip(parameters, least, strict=True) if value < DESIGN.identified]
    if not parameters:
        return None

    def score(tried: Sequence[Design]) -> Floats:
        # Designs come in the order of their rates: of those that suffice, the one with the lowest rate is driven.
        ratios = search.stderr_ratios(parameters, tried, DESIGN.min_repeats)
        return np.asarray(-np.log(np.maximum(ratios, _WELL_IDENTIFIED)).sum(axis=0))

    best = search.best(score)
    ratios = search.stderr_ratios(parameters, [best], DESIGN.min_repeats)[:, 0]
    pins = tuple(item.name for item, value in zip(parameters, ratios, strict=True) if value < DESIGN.identified)
    reductions = ", ".join(
        f"{item.name} to ± {value * item.scale:.2g} ({_now(item)} now)"
        for item, value in zip(parameters, ratios, strict=True)
        if value < DESIGN.identified
    )
    if not pins:
        return None
    trajectory = as_trajectory(best, unit, "next_excitation", "excites what nothing driven so far excites")
    return NextExperiment(
        f"{DESIGN.min_repeats} repeats would reduce the standard error of {reductions}",
        trajectory,
        DESIGN.min_repeats,
        tuple(search.starts(best)),
        (),
        pins,
    )


def _now(item: Unidentified) -> str:
    return "unknown" if item.stderr > _UNKNOWN * item.scale else f"± {item.stderr:.2g}"


def as_trajectory(design: Design, unit: TableUnit, name: str, description: str) -> Trajectory:
    """Return a design as a trajectory."""
    table = CommandTable(unit=unit, rows=design.rows(), duration_s=round(design.duration_s, 3))
    return Trajectory(
        schema=1,
        name=name,
        description=description,
        conditions=("calibrated",),
        target="none",
        commands=table,
        steer_first_s=SET_FIRST_S,
    )


def _names(pair: tuple[Alternative, Alternative]) -> tuple[str, str]:
    return pair[0].name, pair[1].name
