"""From a campaign to the static maps of its vehicle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Literal

from agvbench.calibration.campaign_protocol import CampaignLike, HeaderLike
from agvbench.calibration.free_driving import FreeDriving, read_free_driving
from agvbench.calibration.maps.end_stops import saturated
from agvbench.calibration.maps.map_fit import MapFit, assess_map, rounded
from agvbench.calibration.maps.selection import (
    DRIVE_KINDS,
    STEERING_KINDS,
    compare_maps,
    drive_fitters,
    preferred,
    steering_fitters,
)
from agvbench.calibration.measurement.body_velocity import measure_body_velocity
from agvbench.calibration.measurement.run_measurement import measure_run
from agvbench.calibration.run_samples import arc_samples, described, differential_samples, measure_runs
from agvbench.calibration.samples import CurvePoints, Sample, points_of
from agvbench.campaign.arguments import as_campaign
from agvbench.errors import FitError, InputError, OneOf
from agvbench.model import VehicleModel
from agvbench.types import CALIBRATION_EXPERIMENTS, Run
from agvbench.vehicle.channels import ROLES, Role, channels_of, quantity_of
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, StaticMap

if TYPE_CHECKING:
    import pandas as pd

Maps = Literal["default", "thesis"]
Fits = dict[Role, dict[str, MapFit | FitError]]
Best = dict[Role, MapFit]
MIN_COMMANDS = 4


@dataclass(frozen=True)
class Calibration:
    """A calibrated vehicle and how it came about.

    ``model`` with its provenance; ``fits`` by role (``"front"``, ``"rear"``, ``"drive"``) and kind, the refused kinds
    with their error; ``chosen`` the kind of the model's map by role (``"fixed"`` for an axle whose command never
    varied); ``measurements`` one row per sample (axle, command, value in deg, rad/s or m/s, stderr, run_id, left_out,
    why); ``warnings`` in plain words, what was left out among them.
    """

    model: VehicleModel
    fits: Mapping[Role, Mapping[str, MapFit | FitError]]
    chosen: Mapping[Role, str]
    measurements: pd.DataFrame
    warnings: list[str] = field(default_factory=list)


def calibrate(
    campaign: CampaignLike | str | PathLike[str], *, maps: Maps | str = "default", session: str | None = None
) -> Calibration:
    """Fit the static maps of a vehicle from its calibration runs.

    Runs of the experiments ``steering_front``, ``steering_rear``, ``steering_opposite``, ``drive`` and ``yaw_rate``
    hold one command each and are measured one by one (`measure_run`, `measure_body_velocity`). A campaign without any,
    such as an imported recording of free driving, is read by windows instead (`read_free_driving`). Runs that are not
    ``ok`` are excluded, and so are validation and test runs (``split`` = ``validation`` or ``held_out``).

    Parameters
    ----------
    campaign
        A campaign, or its directory.
    maps
        ``"thesis"``: lines without the outermost pulse, a cubic up to saturation. ``"default"``: for each role the kind
        that predicts left-out commands best.
    session
        Use the runs of this session only.

    Raises
    ------
    FitError
        If there are no runs to calibrate from, none can be measured, or they vary a command too little.
    InputError
        If `campaign` is no campaign, `maps` is unknown or no run belongs to `session`.
    VehicleError
        If the header describes no vehicle.
    """
    if maps not in ("default", "thesis"):
        raise InputError("unknown maps", where="maps", value=repr(maps), limit=OneOf(("default", "thesis")))
    opened = as_campaign(campaign)
    header = opened.header
    geometry = header.geometry
    runs = [run for run in opened if run.split not in {"held_out", "validation"} and session in (None, run.session)]
    if session is not None and not runs:
        raise InputError("no run belongs to this session", where=f"campaign {header.name}", value=repr(session))
    dedicated = [run for run in runs if run.experiment in CALIBRATION_EXPERIMENTS]
    free = None
    if dedicated:
        samples, warnings, used = _from_held_commands(dedicated, geometry, header)
    else:
        geometry.require_two_axles(
            "free driving of a differential vehicle is not calibrated",
            where=f"campaign {header.name}",
            remedy="use agvbench diagnose: its --out writes a vehicle with fitted maps",
        )
        free = read_free_driving(runs, geometry, header)
        samples, warnings, used = free.samples, free.words, free.runs_used
    fits, chosen = _fit_roles(samples, header, maps, free)
    best = {role: fit for role in ROLES if isinstance(fit := fits[role].get(chosen[role]), MapFit)}
    warnings = [*warnings, *_warnings(best, samples, geometry)]
    front, rear, drive = (_chosen_map(role, best, samples) for role in ROLES)
    method = "windows of free driving" if free else "arcs and straights"
    if geometry.is_differential:
        method = "straights and turns on the spot"
    model = VehicleModel(
        name=header.vehicle_name,
        geometry=geometry,
        channels=header.channels,
        front=front,
        rear=rear,
        drive=drive,
        provenance=_provenance(header, method, used, maps, chosen, best, session),
    )
    return Calibration(model, fits, chosen, _table(samples, best, geometry), warnings)


def _from_held_commands(runs: list[Run], geometry: Geometry, header: HeaderLike) -> tuple[list[Sample], list[str], int]:
    neutral = header.neutral
    if geometry.is_differential:
        turned, refused = measure_runs(runs, partial(measure_body_velocity, geometry=geometry, neutral=neutral))
        samples, used = differential_samples(turned, neutral), len(turned)
    else:
        measured, refused = measure_runs(runs, partial(measure_run, geometry=geometry, neutral=neutral))
        samples, used = arc_samples(runs, measured, geometry), len(measured)
    words = described(refused)
    if not used:
        raise FitError(
            "no calibration run can be measured",
            where=f"campaign {header.name}",
            value=f"0 of {len(runs)} runs; {words[0]}",
        )
    return samples, words, used


def _fit_roles(
    samples: list[Sample], header: HeaderLike, maps: str, free: FreeDriving | None
) -> tuple[Fits, dict[Role, str]]:
    fits: Fits = {}
    chosen: dict[Role, str] = {}
    for role in ROLES:
        points = points_of(samples, role)
        if role != "drive" and len(points) == 1:
            fits[role], chosen[role] = {}, "fixed"
        elif role == "drive" and free is not None:
            ramp = assess_map("ramp", free.drive.map, points, parameters=2, stderr=free.drive.stderr)
            fits[role], chosen[role] = {"ramp": replace(ramp, r_squared=free.drive.r_squared)}, "ramp"
        else:
            fits[role], chosen[role] = _fit_role(role, points, header, maps)
    return fits, chosen


def _fit_role(
    role: Role, points: CurvePoints, header: HeaderLike, maps: str
) -> tuple[dict[str, MapFit | FitError], str]:
    where = f"campaign {header.name}: {role}"
    if len(points) < MIN_COMMANDS:
        raise FitError(
            "too few different commands to calibrate",
            where=where,
            value=len(points),
            limit=f"at least {MIN_COMMANDS}",
            remedy="drive bench_calibration.py with its whole grid",
        )
    # Motors set a yaw rate as they set a speed: with a dead band and saturation.
    by_motor = role == "drive" or header.geometry.is_differential
    fitters = drive_fitters(getattr(header.neutral, role)) if by_motor else steering_fitters()
    order = DRIVE_KINDS if by_motor else STEERING_KINDS
    fits = compare_maps(points, fitters)
    try:
        return fits, preferred(fits, ("thesis",) if maps == "thesis" else order).name
    except FitError as error:
        raise FitError(error.what, where=where, value=error.value, limit=error.limit, remedy=error.remedy) from None


def _chosen_map(role: Role, best: Best, samples: list[Sample]) -> StaticMap:
    if role in best:
        return best[role].map
    points = points_of(samples, role)
    return Fixed(output=rounded(float(points.value[0])), command=float(points.command[0]))


def _warnings(best: Best, samples: list[Sample], geometry: Geometry) -> list[str]:
    """Return in words what was left out of the chosen fits, and what looks odd."""
    words = []
    for role in channels_of(geometry):
        quantity = quantity_of(role, geometry)
        name = quantity.name if geometry.is_differential else role
        aside = [s for s in samples if s.role == role and s.why_left_out]
        reasons = Counter(s.why_left_out for s in aside)
        words += [f"{name}: {count} samples left out: {why}" for why, count in reasons.items()]
        if (fit := best.get(role)) is None:
            value = quantity.text(float(points_of(samples, role).value[0]), ".2f")
            words.append(f"{name}: its command never varied; taken as fixed at {value}")
            continue
        words += [f"{name}: {out.command:g} ({quantity.text(out.value)}) left out: {out.why}" for out in fit.left_out]
        if fit.name == "line_with_end_stops":
            words += [
                f"{name}: {out.command:g} ({quantity.text(out.value)}) not on the line: {out.why}"
                for out in saturated(fit)
            ]
        words += [f"{name}: {note}" for note in fit.notes]
    return words


def _provenance(
    header: HeaderLike,
    method: str,
    used: int,
    maps: str,
    chosen: dict[Role, str],
    best: Best,
    session: str | None,
) -> dict[str, str | float | int]:
    """Return where the maps come from; nothing in it depends on when or where the calibration is made."""
    provenance: dict[str, str | float | int] = {
        "campaign": header.name,
        "method": method,
        "maps": maps,
        "runs_used": used,
    }
    if session is not None:
        provenance["session"] = session
    for role in ROLES:
        provenance[f"{role}_fit"] = chosen[role]
        if (fit := best.get(role)) is None:
            continue
        provenance[f"{role}_r_squared"] = round(fit.r_squared, 6)
        provenance[f"{role}_commands"] = len(fit.points)
        if fit.left_out:
            provenance[f"{role}_left_out"] = ", ".join(f"{out.command:g}" for out in fit.left_out)
    return provenance


def _table(samples: list[Sample], best: Best, geometry: Geometry) -> pd.DataFrame:
    import pandas as pd

    reasons = {(role, out.command): out.why for role, fit in best.items() for out in fit.left_out}
    rows = []
    for s in [s for s in samples if s.role in channels_of(geometry)]:
        scale = quantity_of(s.role, geometry).scale
        why = s.why_left_out or reasons.get((s.role, s.command), "")
        rows.append((s.role, s.command, scale * s.value, scale * s.stderr, s.run_id, bool(why), why))
    columns = ["axle", "command", "value", "stderr", "run_id", "left_out", "why"]
    return pd.DataFrame(rows, columns=columns).sort_values(["axle", "command"], kind="stable", ignore_index=True)
