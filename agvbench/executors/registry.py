"""Find an executor by the scheme of its address: a new kind is one module in `agvbench.executors.kinds`."""

from __future__ import annotations

from agvbench.errors import FlagError, OneOf
from agvbench.executors.executor import FLAG, Executor, ExecutorOptions
from agvbench.registry import classes_by_file


def check_address(options: ExecutorOptions) -> type[Executor]:
    """Return the executor that takes the options, which are checked; nothing is opened.

    Raises
    ------
    FlagError
        If no executor takes the address, or the options cannot be used.
    FileError
        If a certificate cannot be used.
    """
    kinds = classes_by_file("agvbench.executors.kinds", Executor)  # type: ignore[type-abstract]
    scheme = options.address.partition("://")[0] if options.address else ""
    for kind in kinds:
        if scheme in kind.schemes:
            kind.check(options)
            return kind
    known = [f"{name}://HOST:PORT" for kind in kinds for name in kind.schemes if name]
    raise FlagError("address cannot be used", where=FLAG, value=repr(options.address), limit=OneOf(known))


def open_executor(options: ExecutorOptions) -> Executor:
    """Return the executor that takes the options, ready to run tasks.

    Raises
    ------
    AgvbenchError
        As `check_address`, or if it cannot be opened.
    """
    return check_address(options).open(options)
