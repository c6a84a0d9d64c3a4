"""The effects: the table of ``agvbench effects``, and their page in the reference."""

from __future__ import annotations

import inspect

from rich.table import Table

from agvbench.effects import Effect, Parameter, Stage, effect_kinds
from agvbench.effects.variants import Variant, effect_variants

_PREFACE = """\
# Effects

An effect is one physical cause that a vehicle model may have beyond static maps and kinematics. In a vehicle file an
effect is a table:

```toml
[[effects]]
name = "steering_lag"
time_constant_s = 0.12
```

The chain is command → transport → servo and drive → wheels → body → floor → camera. Angles are counter-clockwise
positive. An effect whose parameters have their null values does not change the motion. `agvbench effects` lists all
effects. `agvbench effects new NAME` writes the file of a new one; agvbench then simulates, tests, lists and fits it
without further registration ([Write an effect](../how-to/write-an-effect.md)). It may lie in the folder `effects/` of a
lab.
"""
_VARIANTS = """\
# Model variants

A variant describes the cause of an effect by another equation. A diagnosis tries the variants of a selected effect in
its place, and names the effect. A vehicle file names the variant.
"""


def ordered_effects() -> list[type[Effect]]:
    """Return all effects in the order of the chain."""
    stages = list(Stage)
    return sorted(effect_kinds().values(), key=lambda kind: (stages.index(kind.stage), kind.name))


def effects_table() -> Table:
    """Return the table that ``agvbench effects`` prints."""
    table = Table(title="effects that a vehicle model may have, along the chain")
    for heading in ("stage", "effect", "parameter", "unit", "null", "bounds", "relaxes"):
        table.add_column(heading, no_wrap=heading != "relaxes")
    for kind in ordered_effects():
        for i, p in enumerate(kind.parameters()):
            first = (kind.stage.value, kind.name) if i == 0 else ("", "")
            table.add_row(*first, p.name, p.unit, _number(p.null), _bounds(p), kind.relaxes if i == 0 else "")
    return table


def reference_page() -> str:
    """Return ``docs/reference/effects.md``."""
    return "\n".join(
        [_PREFACE, *map(_section, ordered_effects()), _VARIANTS, *map(_section, effect_variants().values())]
    )


def _section(kind: type[Effect]) -> str:
    lines = [f"## {kind.name}", "", inspect.cleandoc(kind.__doc__ or ""), ""]
    lines += ["| parameter | unit | null | bounds | typical size |", "|---|---|---|---|---|"]
    for p in kind.parameters():
        lines.append(f"| `{p.name}` | {p.unit} | {_number(p.null)} | {_bounds(p)} | {_number(p.scale)} |")
    lines += ["", *([f"- Variant of: {kind.variant_of}"] if issubclass(kind, Variant) else [])]
    lines += [f"- Stage: {kind.stage.value}", f"- Relaxes: {kind.relaxes}", f"- Reference: {kind.reference}"]
    lines += [f"- Limits: {kind.limits}", *([f"- Remedy: {kind.remedy}"] if kind.remedy else [])]
    return "\n".join([*lines, ""])


def _bounds(p: Parameter) -> str:
    return f"{_number(p.low)} … {_number(p.high)}"


def _number(value: float) -> str:
    return "∞" if value == float("inf") else f"{value:.4g}".replace("-", "−")
