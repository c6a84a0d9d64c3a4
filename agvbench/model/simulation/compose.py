"""Composition of the compiled kernel, from the loop and the hooks of all effects.

The kernel is a module file, so that numba can cache its machine code. It contains the text of the loop and of the files
that call stages, with one function per stage that calls the hooks in turn. The name of the file has a hash of every
source in it; see `agvbench.compiled`.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

from agvbench.compiled import cache_directory, source_digest
from agvbench.effects import HOOKS, TIME_HOOKS, Effect
from agvbench.errors import FileError
from agvbench.model.simulation import commands as simulation_commands
from agvbench.model.simulation import frames as simulation_frames
from agvbench.model.simulation import level as simulation_level
from agvbench.model.simulation import loop as simulation_loop
from agvbench.model.simulation import stages as simulation_stages
from agvbench.model.simulation import step as simulation_step

# The files of the kernel that call stages directly or indirectly, each after those that it imports.
_PARTS = (simulation_commands, simulation_frames, simulation_step, simulation_level, simulation_loop)
_INSIDE = {simulation_stages.__name__, *(part.__name__ for part in _PARTS)}
_ACTUATE, _ACTUATE_ANY_ORDER = "actuate", "actuate_any_order"
_SECOND_ORDER = {"STEERING_INERTIA", "STEERING_ACCELERATION", "COAST_SPRING", "DRIVE_INERTIA"}


@cache
def kernel(kinds: tuple[type[Effect], ...]) -> Callable[..., None]:
    """Return the compiled ``simulate`` of `agvbench.model.simulation.loop` with the hooks of `kinds`.

    Parameters are laid out in the order of `kinds`; after them, a number for each kind is 0 if it is at null, whose
    hooks are then not called. Compiling takes some seconds, once per set of effects and version.

    Raises
    ------
    FileError
        If there is no directory to keep the kernel in.
    """
    text = kernel_text(kinds)
    packages = {"agvbench", *(kind.__module__.partition(".")[0] for kind in kinds)}
    name = f"kernel_{source_digest(text, *sorted(packages))}"
    path = cache_directory() / f"{name}.py"
    try:
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            _write(path, text)
    except OSError as error:
        remedy = "set AGVBENCH_CACHE to a directory that can be written"
        raise FileError(f"cannot keep compiled code ({error.strerror})", where=path, remedy=remedy) from None
    simulate: Callable[..., None] = _load(f"agvbench_{name}", path).simulate
    return simulate


def kernel_text(kinds: Sequence[type[Effect]]) -> str:
    """Return the source of the kernel with the hooks of `kinds`."""
    hook_imports, stages = _stages(kinds)
    second_order = any(_SECOND_ORDER & {*hook.__code__.co_names} for kind in kinds for hook in kind.hooks().values())
    imports, bodies = [], []
    for part in _PARTS:
        source = inspect.getsource(part)
        head = [node for node in ast.parse(source).body if isinstance(node, ast.Import | ast.ImportFrom)]
        imports += [ast.unparse(_chosen(node, second_order)) for node in head if not _is_inside(node)]
        bodies.append("".join(source.splitlines(keepends=True)[head[-1].end_lineno :]))
    lines = dict.fromkeys([*imports, *hook_imports])
    return "".join(f"{line}\n" for line in lines) + "\n" + "\n".join([*stages, *bodies])


def _is_inside(node: ast.Import | ast.ImportFrom) -> bool:
    """Whether an import is from the kernel itself: another part of it, or a stage."""
    return isinstance(node, ast.ImportFrom) and node.module in _INSIDE


def _chosen(node: ast.Import | ast.ImportFrom, second_order: bool) -> ast.Import | ast.ImportFrom:
    """Return the import with actuators of any order in place of those of first order, if an effect needs them."""
    for alias in node.names:
        if alias.name == _ACTUATE and second_order:
            alias.name, alias.asname = _ACTUATE_ANY_ORDER, _ACTUATE
    return node


def _stages(kinds: Sequence[type[Effect]]) -> tuple[list[str], list[str]]:
    """Return the imports of effects, and one function for each stage that calls their hooks."""
    imports, stages = [], []
    parameters = sum(len(kind.parameters()) for kind in kinds)
    for stage in HOOKS:
        calls, first = [], 0
        for index, kind in enumerate(kinds):
            count = len(kind.parameters())
            if stage in kind.hooks():
                imports.append(f"from {kind.__module__} import {kind.__qualname__}")
                alias = f"_{stage}_{kind.name}"
                stages.append(f"{alias} = compiled(inner=True)({kind.__qualname__}.{stage})\n")
                values = "".join(f", p[{i}]" for i in range(first, first + count))
                time = ", time_s" if stage in TIME_HOOKS else ""
                call = f"{'time_s = ' if time else ''}{alias}(s{time}{values})"
                calls.append(f"    if p[{parameters + index}] != 0.0:\n        {call}\n")
            first += count
        stages.append(_stage(stage, calls))
    return imports, stages


def _stage(name: str, calls: Sequence[str]) -> str:
    time = name in TIME_HOOKS
    arguments = "s, time_s, p" if time else "s, p"
    body = "".join(calls) + ("    return time_s\n" if time else "    return\n")
    return f"\n@compiled(inner=True)\ndef {name}({arguments}):\n{body}\n"


def _write(path: Path, text: str) -> None:
    """Write the whole file or nothing, because other processes may be writing it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    Path(temporary).replace(path)


def _load(name: str, path: Path) -> ModuleType:
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None  # noqa: S101, PT018 - a path to a .py file has both
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
