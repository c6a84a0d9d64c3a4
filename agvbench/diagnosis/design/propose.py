"""The diagnosis with the next experiment."""

from __future__ import annotations

import dataclasses

import numpy as np

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.criteria import DESIGN
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.design.identifiability import unidentified
from agvbench.diagnosis.design.next_experiment import discriminate, identify
from agvbench.diagnosis.proposal import NextExperiment
from agvbench.diagnosis.result import Diagnosis, Verdict
from agvbench.diagnosis.selection.candidates import candidates
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.errors import AgvbenchError
from agvbench.planning import Trajectory, Workspace
from agvbench.planning.trajectories.shapes import Slalom
from agvbench.vehicle.geometry import Geometry


def with_next_experiment(
    found: Diagnosis, selection: Selection, readings: Readings, header: HeaderLike, seed: int
) -> Diagnosis:
    """Return `found` with the run that discriminates alternatives or, without any, identifies parameters.

    ``provenance["inseparable"]`` lists the pairs that no run can discriminate, with the required measurement;
    ``provenance["not_identifiable"]`` the parameters that these data do not identify.
    """
    chosen = selection.chosen.fit
    tried = candidates(chosen.predictor.batch.geometry)
    workspace = covered_workspace(readings, chosen.predictor.batch.geometry)
    unit = header.channels.table_unit
    alternatives = {e.name: {name: 0.0 for name in e.confounded_with if name in tried} for e in found.effects}
    alternatives = {name: others for name, others in alternatives.items() if others}
    flat = unidentified(chosen, tried)
    extra: dict[str, object] = {}
    experiment = None
    if workspace is not None and alternatives:
        proposal = discriminate(chosen, alternatives, tried, unit=unit, workspace=workspace, seed=seed)
        experiment = proposal.experiment
        extra["inseparable"] = [{"between": list(pair), "needs": n} for pair, n in proposal.inseparable.items()]
    if flat:
        extra["not_identifiable"] = {item.name: item.why for item in flat}
    # An answer that is whole needs no further run for effects that were never excited and never asked for.
    if experiment is None and workspace is not None and flat:
        experiment = identify(chosen, flat, unit=unit, workspace=workspace, seed=seed)
    return dataclasses.replace(found, next_experiment=experiment, provenance={**found.provenance, **extra})


def with_first_experiment(found: Diagnosis) -> Diagnosis:
    """Return a diagnosis NOT_IDENTIFIABLE with a first run to drive: repeated, turning, at speed."""
    if found.verdict is not Verdict.NOT_IDENTIFIABLE or found.next_experiment is not None:
        return found
    slalom = Trajectory(
        schema=1,
        name="next_slalom",
        description="moves, turns both ways while driving, and is repeated",
        target="none",
        steering="front",
        slalom=Slalom(turn="left", radius_m=1.0, angle_deg=60.0, arcs=4),
    )
    repeats = DESIGN.min_repeats
    why = f"not identifiable from this campaign ({found.why}); {repeats} repeats of a slalom move, turn and repeat"
    return dataclasses.replace(found, next_experiment=NextExperiment(why, slalom, repeats))


def covered_workspace(readings: Readings, geometry: Geometry) -> Workspace | None:
    """Return the convex hull of the axle positions so far as workspace; None if it has no area.

    The size of the floor is unknown, but the vehicle may drive where it has been before.
    """
    from scipy.spatial import ConvexHull, QhullError

    poses = readings.poses.reshape(-1, 3)
    poses = poses[np.isfinite(poses).all(axis=1)]
    forward = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    points = np.concatenate(
        [poses[:, :2] + geometry.front_axle_m * forward, poses[:, :2] - geometry.rear_axle_m * forward]
    )
    try:
        corners = points[ConvexHull(points).vertices]
        return Workspace.polygon([(float(x), float(y)) for x, y in corners], 0.0)
    except (QhullError, ValueError, AgvbenchError):
        return None
