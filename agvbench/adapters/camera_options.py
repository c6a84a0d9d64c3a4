"""What is said of a camera on the command line: ``NAME=VALUE``."""

from __future__ import annotations

from collections.abc import Iterable

from agvbench.errors import FlagError


def camera_options(pairs: Iterable[str]) -> dict[str, str]:
    """Return the camera's parameters by name.

    >>> camera_options(["lost=0.01"])
    {'lost': '0.01'}

    Raises
    ------
    FlagError
        If a pair has no ``=``.
    """
    options: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals and value):
            raise FlagError(
                "not a parameter and its value", where="--camera", value=repr(pair), remedy="write NAME=VALUE"
            )
        options[name] = value
    return options
