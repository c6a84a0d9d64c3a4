"""The one way in which this package compiles functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from agvbench.compiled import cached_njit

F = TypeVar("F", bound=Callable[..., Any])

#: Sums may be reordered and fused, but NaN and infinity keep their meaning.
FAST = frozenset({"contract", "nsz", "arcp", "reassoc"})


def compiled(*, fast: bool = False, inner: bool = False, inline: bool = False) -> Callable[[F], F]:
    """Return numba's decorator for a function at module level: cached on disk, without the interpreter's lock.

    An `inner` function is called from compiled functions only, which saves compiling its wrapper, and becomes a part
    of them: left to itself the compiler stops doing so at some size, and the simulation takes a third longer. It may
    not make arrays, and so counts no references to any: atomic, at every step, those took a quarter of the simulation.
    With `inline` its body goes into the caller before types are known, so that constants reach it.
    Division by zero gives an infinity as in NumPy: a check for it would keep loops from being vectorised.
    """
    return cached_njit(
        nogil=True,
        error_model="numpy",
        fastmath=set(FAST) if fast else False,
        inline="always" if inline else "never",
        forceinline=inner,
        no_cpython_wrapper=inner,
        no_cfunc_wrapper=inner,
        _nrt=not inner,
    )
