"""Check that the class of an effect is complete before anything is compiled."""

from __future__ import annotations

import dataclasses
import difflib
import inspect

from agvbench.effects.base import HOOKS, TIME_HOOKS, Effect, Hook
from agvbench.errors import FileError, OneOf
from agvbench.own_modules import shown_file

MANDATORY = ("name", "stage", "relaxes", "reference", "limits")
_HOW_TO = "see docs/how-to/write-an-effect.md"
_DECLARED = {*vars(Effect), *dir(object)}


def check_declaration(kind: type[Effect]) -> None:
    """Check attributes, parameters and hooks of an effect's class.

    Raises
    ------
    FileError
        If an attribute is missing, a field is no `parameter`, there is no hook, or a hook has another stage or other
        arguments than the simulation calls it with.
    """
    missing = [name for name in MANDATORY if not hasattr(kind, name)]
    if missing:
        raise _error(kind, "a class attribute is missing", missing[0], f"add it; {_HOW_TO}")
    if "__dataclass_params__" not in vars(kind):
        raise _error(kind, "is no dataclass", kind.__name__, "write @dataclass(frozen=True) above the class")
    bare = [field.name for field in dataclasses.fields(kind) if "unit" not in field.metadata]
    if bare:
        raise _error(kind, "a field is no parameter", bare[0], f"write {bare[0]}: float = parameter(unit=…, …)")
    if not kind.hooks():
        raise _error(kind, "has no hook", _nearest_hook(kind), f"write one of {', '.join(HOOKS)} as a static method")
    for name, hook in kind.hooks().items():
        _check_hook(kind, name, hook)


def _check_hook(kind: type[Effect], name: str, hook: Hook) -> None:
    if kind.stage not in HOOKS[name]:
        where = f"{source_of(kind)}: hook {name}"
        raise FileError("is no hook of the effect's stage", where=where, value=kind.stage, limit=OneOf(HOOKS[name]))
    if not isinstance(inspect.getattr_static(kind, name), staticmethod):
        raise _error(kind, "is no static method", f"hook {name}", "write @staticmethod above it")
    time = ("time_s",) if name in TIME_HOOKS else ()
    wanted = ("state", *time, *(p.name for p in kind.parameters()))
    given = tuple(inspect.signature(hook).parameters)
    if given != wanted:
        where = f"{source_of(kind)}:{hook.__code__.co_firstlineno}: hook {name}"
        remedy = f"write def {name}({', '.join(wanted)})"
        raise FileError("has other arguments than its effect", where=where, value=", ".join(given), remedy=remedy)


def _nearest_hook(kind: type[Effect]) -> str:
    """Return a method of the class that may be a misspelt hook, else the name of the class."""
    own = [name for name in vars(kind) if name not in _DECLARED and callable(getattr(kind, name))]
    return next((name for name in own if difflib.get_close_matches(name, HOOKS, 1)), kind.__name__)


def _error(kind: type[Effect], what: str, value: str, remedy: str) -> FileError:
    return FileError(what, where=source_of(kind), value=value, remedy=remedy)


def source_of(kind: type[Effect]) -> str:
    """Return the file of an effect's class, from the current folder where it lies in it."""
    return shown_file(inspect.getfile(kind))
