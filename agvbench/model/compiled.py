"""The decorator that compiles the functions of this package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from agvbench.compiled import cached_njit

F = TypeVar("F", bound=Callable[..., Any])

#: Sums may be reordered and fused, but NaN and infinity keep their meaning.
FAST = frozenset({"contract", "nsz", "arcp", "reassoc"})


def compiled(*, fast: bool = False, inner: bool = False, inline: bool = False) -> Callable[[F], F]:
    """Return numba's decorator for a function at module level: cached on disk, without the interpreter's lock.

    An `inner` function is called from compiled functions only. It has no wrapper, which saves compilation time, and is
    always inlined by LLVM: without forced inlining the simulation takes a third longer. It may not create arrays, and
    therefore counts no references: atomic counting took a quarter of the simulation.

    With `inline`, the body is inlined before types are inferred, so that constants propagate. Division by zero gives an
    infinity as in NumPy, because a check would prevent vectorisation.
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
