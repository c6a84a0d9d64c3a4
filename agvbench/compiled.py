"""Machine code that is kept on disk, under a hash of every source from which it was compiled.

numba by itself compiles a function again when the file of the function has changed, and not when a file has changed
whose functions or constants are compiled into it. It lies in ``$NUMBA_CACHE_DIR`` or ``$AGVBENCH_CACHE``, else in the
user's cache. The light installation has no numba: functions are then run by Python, with the same results and slower.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import inspect
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

try:
    import numba
    from numba.core import event
except ModuleNotFoundError:  # the light installation
    numba = None

F = TypeVar("F", bound=Callable[..., Any])

_LOCK = threading.Lock()
COMPILING = "compiling the simulation to machine code (once per machine; takes up to a minute) …"


def cached_njit(**options: Any) -> Callable[[F], F]:
    """Return ``numba.njit(cache=True, **options)`` for a function at module level; without numba, the function itself.

    It is compiled again when its file changes, or one of the same package or of agvbench that this imports at its top,
    directly or not.
    """

    def decorate(function: F) -> F:
        if numba is None:
            return function
        config = numba.config
        text = Path(inspect.getfile(function)).read_text(encoding="utf-8")
        digest = source_digest(text, "agvbench", function.__module__.partition(".")[0], module=function.__module__)
        with _LOCK:
            before, config.CACHE_DIR = config.CACHE_DIR, str(Path(config.CACHE_DIR or cache_directory()) / digest)
            try:
                decorated: F = numba.njit(cache=True, **options)(function)
            finally:
                config.CACHE_DIR = before
        return decorated

    return decorate


@contextmanager
def announcing_compilation(on_progress: Callable[[str], None]) -> Iterator[None]:
    """Have `on_progress` say once that agvbench is compiled, where no machine code is kept: it takes up to a minute."""
    if numba is None:
        yield
        return
    with event.install_listener("numba:compile", _first_compilation(on_progress)):
        yield


def _first_compilation(on_progress: Callable[[str], None]) -> Any:
    """Return what reports the first function of agvbench that is compiled; one loaded from disk is no event."""

    class FirstCompilation(event.Listener):  # type: ignore[misc] # numba is not typed
        reported = False

        def on_start(self, event: Any) -> None:
            module = event.data["dispatcher"].py_func.__module__
            if not self.reported and module.startswith("agvbench."):
                self.reported = True
                on_progress(COMPILING)

        def on_end(self, event: Any) -> None:
            """Nothing: the first run shows that it has ended."""

    return FirstCompilation()


def cache_directory() -> Path:
    """Return where machine code is kept: ``$AGVBENCH_CACHE``, else in the user's cache."""
    if chosen := os.environ.get("AGVBENCH_CACHE"):
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "agvbench"


@cache
def source_digest(text: str, *packages: str, module: str = "") -> str:
    """Return a hash of a source and of all modules of `packages` that it imports at its top, directly or not.

    Parameters
    ----------
    text
        The source.
    packages
        Names of top-level packages or modules; what else is imported has no part in the hash.
    module
        The source's own name, for relative imports.
    """
    known, found = {module}, [text]
    waiting = [*_imported(text, module)]
    while waiting:
        name = waiting.pop()
        if name not in known and name.partition(".")[0] in packages:
            known.add(name)
            own = _file(name)
            found.append(own.read_text(encoding="utf-8") if own else "")
            waiting += _imported(found[-1], name)
    return hashlib.sha256("\0".join([numba.__version__, *found]).encode()).hexdigest()[:16]


@cache
def _imported(text: str, module: str) -> tuple[str, ...]:
    """Return the modules that a source imports at its top, in order."""
    return tuple(dict.fromkeys(name for node in ast.parse(text).body for name in _names(node, module)))


def _names(node: ast.stmt, module: str) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        package = "." * node.level + (node.module or "")
        if node.level:
            package = importlib.util.resolve_name(package, module.rpartition(".")[0])
        for alias in node.names:
            inside = f"{package}.{alias.name}"
            yield inside if _file(inside) else package


@cache
def _file(module: str) -> Path | None:
    """Return the source file of a module; None where there is none of that name."""
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec and spec.origin and spec.origin.endswith(".py") else None
