"""A diagnosis in words, from its JSON, which anyone may have written: whatever it lacks is left out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agvbench.diagnosis import NamedEffect

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
COLUMNS = {"before": "before", "after": "after", "floor": "repeatability"}
"""Headings of the errors of a quantity, by their name in the JSON."""
DEFINITIONS = (
    "Errors are measured minus predicted. End position error: distance between the two end positions; along and "
    "across: its components along x and y of the start frame. The heading error is the thesis' Δδ. Δs compares "
    "distances from start to end, and hardly sees an error across."
)


def effect_in_words(effect: NamedEffect) -> str:
    """Return one line on an effect: its parameters, and what cannot be told from it."""
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


def next_in_words(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what to drive next, what no run can tell apart, and which parameters these runs do not pin."""
    if following := mapping(content.get("next_experiment")):
        yield f"Next run, {mapping(following.get('trajectory')).get('name')}: {following.get('why')}."
    provenance = mapping(content.get("provenance"))
    for item in map(mapping, items(provenance.get("inseparable"))):
        between = " from ".join(map(str, items(item.get("between"))))
        yield f"No run from rest to rest tells {between}; it takes {item.get('needs')}."
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
