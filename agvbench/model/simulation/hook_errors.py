"""The hook that makes the simulation impossible to compile, named with its file and line.

The compiler reports the chain of callers from the kernel down to the hook, in dozens of lines. Each hook is therefore
compiled alone, with the options and types of the kernel, so that machine code which exists already is used.
"""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Iterable
from pathlib import Path

from agvbench.effects import TIME_HOOKS, Effect
from agvbench.effects.base import Hook
from agvbench.effects.declaration import source_of
from agvbench.errors import FileError
from agvbench.model.compiled import compiled

_REMEDY = "use arithmetic, math and constants of the file only; see docs/how-to/write-an-effect.md"
_PIPELINE = re.compile(r"Failed in nopython mode pipeline.*|\.*\s*Raised from .*")
_CALL = re.compile(r"No implementation of function .*>>> (?P<call>[^\n]+)", re.DOTALL)
_NAME = re.compile(r"NameError: (?P<what>name '(?P<name>\w+)' is not defined)")
_GLOBAL = re.compile(r"Untyped global name '(?P<name>\w+)'")


def check_hooks(kinds: Iterable[type[Effect]]) -> None:
    """Compile every hook of `kinds` alone.

    Raises
    ------
    FileError
        If one cannot be compiled, or returns something else than the simulation expects.
    """
    for kind in kinds:
        for name, hook in kind.hooks().items():
            _check(kind, name, hook)


def _check(kind: type[Effect], name: str, hook: Hook) -> None:
    import numba  # not in the light installation, which simulates no vehicle

    is_time = name in TIME_HOOKS
    floats = (numba.float64,) * (is_time + len(kind.parameters()))
    function = compiled(inner=True)(hook)
    try:
        function.compile((numba.float64[::1], *floats))  # type: ignore[attr-defined] # a dispatcher of numba
    except Exception as error:
        raise _translated(kind, name, hook, error) from error
    returned = function.nopython_signatures[0].return_type  # type: ignore[attr-defined]
    if is_time != (returned == numba.float64):
        where = f"{_place(kind, hook)}: hook {name}"
        remedy = "return the time as a float in every case" if is_time else "change the state and return nothing"
        raise FileError("returns the wrong type", where=where, value=str(returned), remedy=remedy)


def _translated(kind: type[Effect], name: str, hook: Hook, error: Exception) -> FileError:
    text = str(error)
    where = f"{_place(kind, hook, error)}: hook {name}"
    if undefined := _NAME.search(text):
        return FileError(undefined["what"], where=where, remedy=_near(undefined["name"], hook))
    if foreign := _GLOBAL.search(text):
        remedy = "write its equation into the hook; constants are numbers"
        return FileError("can use neither functions nor objects of its file", where=where, value=foreign["name"],
                         remedy=remedy)  # fmt: skip
    if "NRT required" in text:
        return FileError("creates a list, an array or a text", where=where, remedy=_REMEDY)
    if call := _CALL.search(text):
        what = "the compiler knows no such function of these types"
        return FileError(what, where=where, value=call["call"], remedy=_REMEDY)
    return FileError("cannot be compiled", where=where, value=_first(text), remedy=_REMEDY)


def _first(text: str) -> str:
    """Return the first line of a compiler's message that says something."""
    lines = (_PIPELINE.sub("", line).strip() for line in text.splitlines())
    return next((line for line in lines if line), "unknown reason")


def _near(name: str, hook: Hook) -> str:
    """Return what to do about an undefined name."""
    known = [*hook.__code__.co_varnames, *hook.__globals__]
    close = difflib.get_close_matches(name, known, 1)
    meant = f"did you mean {close[0]}? else " if close else ""
    return f"{meant}define it, or import it from agvbench.effects.state"


def _place(kind: type[Effect], hook: Hook, error: Exception | None = None) -> str:
    """Return file and line: that of the compiler's error if it states one, else the first of the hook."""
    file = Path(inspect.getfile(hook)).name
    stated = re.search(rf"{re.escape(file)} \((\d+)\)|{re.escape(file)}\", line (\d+)", str(error))
    lines = [getattr(getattr(error, "loc", None), "line", None), *(stated.groups() if stated else ())]
    return f"{source_of(kind)}:{next((line for line in lines if line), hook.__code__.co_firstlineno)}"
