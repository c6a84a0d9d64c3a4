"""What is said of a camera on the command line: ``NAME=VALUE``, several with commas or one after another."""

from __future__ import annotations

from collections.abc import Iterable

from agvbench.errors import FlagError


def camera_options(pairs: Iterable[str]) -> dict[str, str]:
    """Return the camera's parameters by name.

    >>> camera_options(["lost=0.01,rate_hz=240", "up=z"])
    {'lost': '0.01', 'rate_hz': '240', 'up': 'z'}

    Raises
    ------
    FlagError
        If a pair has no ``=``.
    """
    options: dict[str, str] = {}
    for pair in filter(None, ",".join(pairs).split(",")):
        name, equals, value = pair.partition("=")
        if not (name and equals and value):
            raise FlagError(
                "not a parameter and its value", where="--camera", value=repr(pair), remedy="write NAME=VALUE"
            )
        options[name] = value
    return options
