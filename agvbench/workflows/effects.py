"""``agvbench effects``: the list of all effects, its page in the reference, and the template of a new one."""

from __future__ import annotations

import inspect
import keyword
import re
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import agvbench.effects
from agvbench.effects import Effect, Parameter, Stage, effect_kinds
from agvbench.effects.forms import Form, effect_forms
from agvbench.errors import FileError, FlagError

if TYPE_CHECKING:
    from rich.table import Table

_TEMPLATE = Path(__file__).parent / "effect_template.py.txt"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
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
    from rich.table import Table

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
    return "\n".join([_PREFACE, *map(_section, ordered_effects()), _LAWS, *map(_section, effect_forms().values())])


def write_template(name: str, directory: Path | None = None) -> Path:
    """Write the file of a new effect; return its path.

    Raises
    ------
    FlagError
        If the name cannot be one, or is taken.
    FileError
        If the file exists or cannot be written.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        remedy = "use lower case words with underscores, as in servo_warm_up"
        raise FlagError("cannot be the name of an effect", where="NAME", value=repr(name), remedy=remedy)
    path = (directory or Path(agvbench.effects.__file__).parent) / f"{name}.py"
    if name in effect_kinds():
        raise FlagError("there is an effect of this name", where="NAME", value=name, remedy="choose another")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(template_text(name))
    except FileExistsError:
        raise FileError("exists already", where=path, remedy="choose another name") from None
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=path, remedy="choose another --dir") from None
    return path


def template_text(name: str) -> str:
    """Return the file of a new effect called `name`."""
    words = {"name": name, "class_name": "".join(word.capitalize() for word in name.split("_"))}
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(words)


def _section(kind: type[Effect]) -> str:
    lines = [f"## {kind.name}", "", inspect.cleandoc(kind.__doc__ or ""), ""]
    lines += ["| parameter | unit | null | bounds | typical size |", "|---|---|---|---|---|"]
    for p in kind.parameters():
        lines.append(f"| `{p.name}` | {p.unit} | {_number(p.null)} | {_bounds(p)} | {_number(p.scale)} |")
    lines += ["", *([f"- Law of: {kind.form_of}"] if issubclass(kind, Form) else [])]
    lines += [f"- Stage: {kind.stage.value}", f"- Relaxes: {kind.relaxes}", f"- Reference: {kind.reference}"]
    return "\n".join([*lines, f"- Limits: {kind.limits}", ""])


def _bounds(p: Parameter) -> str:
    return f"{_number(p.low)} … {_number(p.high)}"


def _number(value: float) -> str:
    return "∞" if value == float("inf") else f"{value:.4g}".replace("-", "−")
