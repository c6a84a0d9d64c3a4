"""A diagnosis as it lies in a campaign directory: its JSON, the residuals to be drawn, and its words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.errors import FileError
from agvbench.text_files import read_json
from agvbench.workflows.output_files import write_file

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.diagnosis import Diagnosis, NamedEffect

JSON, RESIDUALS = "diagnosis.json", "residuals.parquet"
_NUMBERS = (
    "time_in_run_s", "speed_mps", "curvature_per_m", "direction", "campaign_time_h", "x_m", "y_m", "length_m",
    *(f"{when}_{feature}" for when in ("before", "after") for feature in ("speed", "sideways", "turning")),
)  # fmt: skip


@dataclass(frozen=True)
class ShownDiagnosis:
    """The ``content`` of the JSON (schema 1), and the ``residuals``, or None where they were not kept."""

    content: Mapping[str, Any]
    residuals: pd.DataFrame | None = None
    problems: tuple[str, ...] = field(default_factory=tuple)


def shown(found: Diagnosis) -> ShownDiagnosis:
    """Return a diagnosis just made, to be reported."""
    return ShownDiagnosis(found.to_json(), found.residuals)


def keep(found: Diagnosis, json_file: Path) -> None:
    """Write the residuals beside the JSON where that is a campaign's own `JSON`."""
    if json_file.name == JSON and (json_file.parent / "campaign.toml").exists():
        keep_residuals(found, json_file.parent)


def keep_residuals(found: Diagnosis, directory: Path) -> None:
    """Write the residuals into a directory in which the JSON lies.

    Raises
    ------
    FileError
        If they cannot be written.
    """
    residuals = found.residuals
    if residuals is not None:
        write_file("--json", directory / RESIDUALS, lambda path: residuals.to_parquet(path, index=False))


def read_diagnosis(directory: Path) -> ShownDiagnosis | None:
    """Return the diagnosis that lies in a campaign directory, or None if there is none.

    What cannot be read is said in ``problems``, not raised: a report is of the campaign first.
    """
    path = directory / JSON
    if not path.exists():
        return None
    try:
        content = read_json(path)
    except (OSError, ValueError, FileError) as error:
        return ShownDiagnosis({}, None, (f"{JSON} cannot be read: {error}.",))
    if not isinstance(content, dict) or content.get("schema") != 1:
        return ShownDiagnosis({}, None, (f"{JSON} is not a diagnosis of schema 1.",))
    residuals, problems = _residuals(directory / RESIDUALS)
    return ShownDiagnosis(content, residuals, problems)


def _residuals(path: Path) -> tuple[pd.DataFrame | None, tuple[str, ...]]:
    import numpy as np
    import pandas as pd

    if not path.exists():
        return None, ()
    try:
        table = pd.read_parquet(path)
        numbers = pd.DataFrame({name: table[name].astype(float) for name in _NUMBERS})
    except (OSError, ValueError, KeyError) as error:
        return None, (f"{RESIDUALS} cannot be read: {error}.",)
    return numbers.loc[np.isfinite(numbers.to_numpy()).all(axis=1)], ()


QUANTITIES = {
    "end_position_mm": "end position error [mm]",
    "end_position_median_mm": "end position error, median [mm]",
    "along_mm": "along at the end [mm]",
    "across_mm": "across at the end [mm]",
    "delta_heading_deg": "heading error at the end [°]",
    "delta_s_mm": "Δs at the end [mm]",
    "position_rms_mm": "position along the way [mm]",
    "heading_rms_deg": "heading along the way [°]",
}
"""What errors before and after are of, by their name in the JSON."""
COLUMNS = {"before": "before", "after": "after", "floor": "repeatability", "reproducibility": "reproducibility"}
"""Headings of the errors of a quantity, by their name in the JSON."""
DEFINITIONS = (
    "Errors are measured minus predicted. End position error: distance between the two end positions; along and "
    "across: its components along x and y of the start frame. The heading error is the thesis' Δδ. Δs compares "
    "distances from start to end, and hardly sees an error across."
)


def effect_in_words(effect: NamedEffect) -> str:
    """Return one line on an effect: its parameters, and what cannot be distinguished from it."""
    parts = []
    for name, e in effect.parameters.items():
        unit = "" if e.unit == "–" else f" {e.unit}"
        parts.append(f"{name} = {e.value:.4g} ± {e.stderr:.2g}{unit}" + (f" ({e.note})" if e.note else ""))
    line = f"{effect.name}: {', '.join(parts)}"
    return line + (f"; or instead {', '.join(effect.confounded_with)}" if effect.confounded_with else "")


def left_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield on what the rest depends."""
    for d in map(mapping, items(mapping(content.get("unexplained")).get("depends_on"))):
        share, p_value = number(d.get("share")), number(d.get("p_value"))
        known = [f"{100.0 * share:.0f} % of it"] * (not math.isnan(share))
        known += [f"p = {p_value:.1g}"] * (not math.isnan(p_value))
        of_it = f" ({', '.join(known)})" if known else ""
        if "covariate" in d:
            yield f"What is left depends on {d['covariate']} through {d.get('through', 'the motion')}{of_it}."


def term_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield the parameters of the discrepancy term of free driving, and whether it holds in the test windows."""
    term = mapping(mapping(content.get("provenance")).get("empirical_term"))
    errors = mapping(term.get("held_out_position_mm"))
    now, without = number(errors.get("with")), number(errors.get("without"))
    if math.isnan(now + without):
        return
    values = ", ".join(f"{name} = {number(value):.3g}" for name, value in mapping(term.get("parameters")).items())
    holds = "holds" if now < without else "does not hold"
    yield f"{term.get('name')}: {values}."
    yield (
        f"It {holds} in the test windows: position error {now:.0f} mm with it, {without:.0f} mm without it (as fitted)."
    )


def fit_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield which runs the lack of fit is of, the repeatability of which runs it is compared with, and its p-value."""
    provenance = mapping(content.get("provenance"))
    runs, p_value = mapping(provenance.get("lack_of_fit_runs")), number(provenance.get("lack_of_fit_p_value"))
    tested, repeats = number(runs.get("tested")), number(runs.get("repeats"))
    if not any(map(math.isnan, (tested, repeats, p_value))):
        among = f"against the repeatability in {repeats:.0f} validation and test runs"
        yield f"Lack of fit of the {tested:.0f} test runs, {among}: p = {p_value:.2g}."


def remedies_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what to do in the workshop about each effect."""
    for effect in map(mapping, items(content.get("effects"))):
        if remedy := effect.get("remedy"):
            yield f"Remedy of {effect.get('name')}: {remedy}."


def sessions_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what differs in single sessions of free driving: the clock of the camera, and the level of the drive."""
    windows = mapping(mapping(content.get("provenance")).get("windows"))
    for name, found in mapping(windows.get("sessions")).items():
        clock, level = (mapping(mapping(found).get(key)) for key in ("clock_offset", "drive_level"))
        if clock.get("significant"):
            value_s, stderr_s = number(clock.get("value_s")), number(clock.get("stderr_s"))
            offset = f"{abs(value_s):.3f} ± {stderr_s:.3f} s {'behind' if value_s > 0.0 else 'ahead of'} the others"
            yield f"Session {name}: camera clock {offset}; its commands were moved by that."
        if level.get("significant"):
            factor, stderr = number(level.get("factor")), number(level.get("stderr"))
            yield f"Session {name}: the same drive commands give {factor:.2f} ± {stderr:.2f} times the others' speed."
    yield from _varying_in_words(mapping(windows.get("varying")))


def logged_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield which logged columns were not used, with the reasons."""
    left_out = mapping(mapping(mapping(content.get("provenance")).get("logged_columns")).get("left_out"))
    if left_out:
        first = [f"{name} ({reason})" for name, reason in islice(left_out.items(), _MOST_LEFT_OUT)]
        more = len(left_out) - len(first)
        yield f"Logged columns that were not used: {', '.join(first)}{f', and {more} more' if more else ''}."


_MOST_LEFT_OUT = 5
_CLEARLY = 3.0
_NOTICEABLE = {"gain": 0.03, "offset_rad": 0.005, "offset_per_m": 0.005, "offset_s": 0.02}
_UNITS = {"offset_rad": "rad", "offset_per_m": "1/m", "offset_s": "s"}
_MOST_LOG_GAIN = 3.0


def _varying_in_words(varying: Mapping[str, Any]) -> Iterator[str]:
    """Yield what steering, drive and clock were at the end of a recording, where they clearly differ from the model."""
    for recording, found in mapping(varying.get("recordings")).items():
        differing = []
        for name, entry in mapping(found).items():
            value, stderr = (number(mapping(entry).get(key)) for key in ("value", "stderr"))
            role, _, kind = name.partition("_")
            if not abs(value) > max(_CLEARLY * stderr, _NOTICEABLE.get(kind, math.inf)):
                continue
            if kind == "gain":
                factor = math.exp(min(max(value, -_MOST_LOG_GAIN), _MOST_LOG_GAIN))
                differing.append(f"{role} gain {factor:.2f} ± {factor * stderr:.2f}")
            else:
                differing.append(f"{role} offset {value:.3f} ± {stderr:.3f} {_UNITS[kind]}")
        if differing:
            yield f"Recording {recording} at its end, estimated from its own windows: {', '.join(differing)}."


def extrapolation_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield how many test windows have commands beyond those of the training windows, and in which channels."""
    windows = mapping(mapping(content.get("provenance")).get("windows"))
    tested = [row for row in map(mapping, items(windows.get("recordings"))) if row.get("held_out")]
    beyond = sum(number(mapping(row.get("beyond")).get("windows", 0)) for row in tested)
    if not beyond > 0.0:
        return
    channels = []
    for role, value in mapping(windows.get("commands")).items():
        fitted, test = ([number(v) for v in items(mapping(value).get(key))] for key in ("training", "test"))
        if len(fitted) == len(test) == 2 and (test[0] < fitted[0] or test[1] > fitted[1]):
            channels.append(f"{role} {test[0]:.4g} to {test[1]:.4g} (training: {fitted[0]:.4g} to {fitted[1]:.4g})")
    every = sum(number(row.get("windows")) for row in tested)
    yield (
        f"{beyond:.0f} of {every:.0f} test windows have commands beyond those of the training windows, where the model "
        f"extrapolates: {', '.join(channels)}. For a model of these commands, include them in the training windows."
    )


def states_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield how many effects of the library are absent."""
    states = [mapping(state).get("state") for state in mapping(content.get("states")).values()]
    if absent := states.count("absent"):
        yield f"Absent: {absent} of {len(states)} effects; their 95 % bounds are in the report and the JSON (states)."


def bounds_in_words(state: Mapping[str, Any]) -> str:
    """Return the bounds of an absent effect: ``width_rad ≤ 0.006 rad``; of a limit, ``rate_rad_per_s ≥ 6 rad/s``."""
    return ", ".join(
        f"{name} {sign} {number(mapping(bound).get('value')):.2g} {mapping(bound).get('unit', '')}".removesuffix(" –")
        for key, sign in (("upper_bound", "≤"), ("lower_bound", "≥"))
        for name, bound in mapping(state.get(key)).items()
    )


def next_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what to drive next, what no run can discriminate, and which parameters these runs do not identify."""
    if following := mapping(content.get("next_experiment")):
        yield f"Next run, {mapping(following.get('trajectory')).get('name')}: {following.get('why')}."
    provenance = mapping(content.get("provenance"))
    for item in map(mapping, items(provenance.get("inseparable"))):
        between = " from ".join(map(str, items(item.get("between"))))
        yield f"No run from rest to rest distinguishes {between}; required: {item.get('needs')}."
    for name, why in mapping(provenance.get("not_identifiable")).items():
        yield f"{name} is not identifiable from these runs ({why})."


def mapping(value: object) -> Mapping[str, Any]:
    """Return a mapping as it is, anything else as an empty one."""
    return value if isinstance(value, Mapping) else {}


def items(value: object) -> list[Any]:
    """Return a list as it is, anything else as an empty one."""
    return value if isinstance(value, list) else []


def number(value: object) -> float:
    """Return a number, NaN for anything else."""
    return float(value) if isinstance(value, int | float) else math.nan
