"""What ``agvbench effects`` does beside listing: check the hooks, and write the file of a new effect."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template

import agvbench.effects
from agvbench.effects import HOOKS, TIME_HOOKS, effect_kinds
from agvbench.errors import FileError, FlagError, OneOf

_TEMPLATE = Path(__file__).parent / "effect_template.py.txt"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
DEFAULT_HOOK = "drive"


@dataclass(frozen=True)
class _Stub:
    """An example of a hook: what it scales, by indices of the state, and as an equation."""

    indices: tuple[str, ...]
    equation: str


_STUBS: Mapping[str, _Stub] = {
    "arrive": _Stub((), "t ← t + delay"),
    "aim": _Stub(("SPEED_AIM",), "v ← v (1 + gain)"),
    "adopt": _Stub(("STEERING_LOAD",), "load ← load (1 + gain)"),
    "steer": _Stub(("FRONT", "REAR"), "δ ← δ (1 + gain)"),
    "drive": _Stub(("FRONT_SPEED", "REAR_SPEED"), "v ← v (1 + gain)"),
    "move": _Stub(("FORWARD", "LEFT"), "v ← v (1 + gain)"),
    "drift": _Stub(("X_RATE", "Y_RATE"), "ẋ ← ẋ (1 + gain)"),
    "capture": _Stub((), "t ← t − delay"),
    "see": _Stub(("SEEN_X", "SEEN_Y"), "x ← x (1 + gain)"),
}


def check_effects(on_progress: Callable[[str], None]) -> None:
    """Compile every hook of every effect, once per machine and version.

    Raises
    ------
    FileError
        If a hook cannot be compiled; where it is, and why.
    """
    from agvbench.compiled import announcing_compilation
    from agvbench.model.simulation.hook_errors import check_hooks

    with announcing_compilation(on_progress):
        check_hooks([*effect_kinds().values()][::-1])  # the user's own ones first


def write_template(name: str, directory: Path | None = None, *, hook: str = DEFAULT_HOOK) -> Path:
    """Write the file of a new effect with one hook; return its path.

    Raises
    ------
    FlagError
        If the name cannot be one, or is taken, or there is no such hook.
    FileError
        If the file exists or cannot be written.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        remedy = "use lower case words with underscores, as in servo_warm_up"
        raise FlagError("cannot be the name of an effect", where="NAME", value=repr(name), remedy=remedy)
    path = (directory or Path(agvbench.effects.__file__).parent) / f"{name}.py"
    if name in effect_kinds():
        raise FlagError("there is an effect of this name", where="NAME", value=name, remedy="choose another")
    text = template_text(name, hook)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise FileError("exists already", where=path, remedy="choose another name") from None
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=path, remedy="choose another --dir") from None
    return path


def template_text(name: str, hook: str = DEFAULT_HOOK) -> str:
    """Return the file of a new effect called `name` with a `hook`.

    Raises
    ------
    FlagError
        If there is no such hook.
    """
    if hook not in HOOKS:
        raise FlagError("no such hook", where="--hook", value=hook, limit=OneOf(HOOKS))
    words = {"name": name, "class_name": "".join(word.capitalize() for word in name.split("_"))}
    words |= {"hook": hook, "stage": HOOKS[hook][0].name, "equation": _STUBS[hook].equation}
    words |= _time_hook(hook) if hook in TIME_HOOKS else _state_hook(_STUBS[hook])
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(words)


def _state_hook(stub: _Stub) -> dict[str, str]:
    return {
        "imports": f"from agvbench.effects.state import {', '.join(stub.indices)}\n",
        "parameter": 'gain: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)',
        "arguments": "state: Floats, gain: float",
        "returns": "None",
        "body": "\n".join(f"        state[{index}] *= 1.0 + gain" for index in stub.indices),
    }


def _time_hook(hook: str) -> dict[str, str]:
    sign = "+" if hook == "arrive" else "-"
    return {
        "imports": "",
        "parameter": 'delay_s: float = parameter(unit="s", low=0.0, high=0.5, scale=0.05)',
        "arguments": "state: Floats, time_s: float, delay_s: float",
        "returns": "float",
        "body": f"        return time_s {sign} delay_s",
    }
