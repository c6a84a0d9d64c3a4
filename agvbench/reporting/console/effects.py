"""The effects: the table of ``agvbench effects``, and their page in the reference."""

from __future__ import annotations

import inspect

from rich.table import Table

from agvbench.effects import Effect, Parameter, Stage, effect_kinds
from agvbench.effects.variants import Variant, effect_variants

_PREFACE = """\
# Effects

What a vehicle model may have beyond static maps and kinematics. In a vehicle file an effect is a table:

```toml
[[effects]]
name = "steering_lag"
time_constant_s = 0.12
```

The chain is command → transport → servo and drive → wheels → body → floor → camera. Angles are counter-clockwise
positive. At its null value an effect does nothing. `agvbench effects` lists all of them; `agvbench effects new NAME`
writes the file of a new one, which is then simulated, tested, listed and fitted without another line elsewhere.
"""
_LAWS = """\
# Other laws

The same causes in laws of their own. A diagnosis tries them in place of what it has chosen, and calls them by their
causes; a vehicle file has them under their own names.
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
    return "\n".join([_PREFACE, *map(_section, ordered_effects()), _LAWS, *map(_section, effect_variants().values())])


def _section(kind: type[Effect]) -> str:
    lines = [f"## {kind.name}", "", inspect.cleandoc(kind.__doc__ or ""), ""]
    lines += ["| parameter | unit | null | bounds | typical size |", "|---|---|---|---|---|"]
    for p in kind.parameters():
        lines.append(f"| `{p.name}` | {p.unit} | {_number(p.null)} | {_bounds(p)} | {_number(p.scale)} |")
    lines += ["", *([f"- Law of: {kind.variant_of}"] if issubclass(kind, Variant) else [])]
    lines += [f"- Stage: {kind.stage.value}", f"- Relaxes: {kind.relaxes}", f"- Reference: {kind.reference}"]
    return "\n".join([*lines, f"- Limits: {kind.limits}", ""])


def _bounds(p: Parameter) -> str:
    return f"{_number(p.low)} … {_number(p.high)}"


def _number(value: float) -> str:
    return "∞" if value == float("inf") else f"{value:.4g}".replace("-", "−")
