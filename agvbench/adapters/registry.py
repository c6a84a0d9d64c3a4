"""Adapters by scheme: a file in ``adapters/agv/`` or ``adapters/mocap/`` is an adapter, found by name.

``sim`` and ``serial:/dev/ttyACM0`` are adapter specifications: scheme, then an address behind a colon. ``vicon.py`` and
``lab/vicon.py:192.168.0.3`` name a file instead.
"""

from __future__ import annotations

import difflib
from functools import cache
from typing import TypeVar

from agvbench.adapters import agv, mocap
from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter
from agvbench.adapters.own_file import is_file, open_own, own_adapter
from agvbench.errors import LinkError
from agvbench.registry import classes_by_file

_Adapter = TypeVar("_Adapter", AgvAdapter, MocapAdapter)


@cache
def agv_adapters() -> dict[str, type[AgvAdapter]]:
    """Return the AGV adapters by scheme."""
    return _by_scheme(classes_by_file(agv, AgvAdapter))  # type: ignore[type-abstract]


@cache
def mocap_adapters() -> dict[str, type[MocapAdapter]]:
    """Return the mocap adapters by scheme."""
    return _by_scheme(classes_by_file(mocap, MocapAdapter))  # type: ignore[type-abstract]


def _by_scheme(found: list[type[_Adapter]]) -> dict[str, type[_Adapter]]:
    return {cls.scheme: cls for cls in sorted(found, key=lambda cls: cls.scheme)}


def parse_spec(spec: str) -> tuple[str, str]:
    """Return scheme and address of an adapter specification.

    >>> parse_spec("serial:/dev/ttyACM0"), parse_spec("sim")
    (('serial', '/dev/ttyACM0'), ('sim', ''))
    """
    scheme, _, address = spec.partition(":")
    return scheme, address


def open_agv(spec: str, options: AdapterOptions) -> AgvAdapter:
    """Open the AGV adapter that `spec` names, or raise `LinkError`."""
    return _opened("agv", spec, options, agv_adapters(), AgvAdapter)  # type: ignore[type-abstract]


def open_mocap(spec: str, options: AdapterOptions) -> MocapAdapter:
    """Open the mocap adapter that `spec` names, or raise `LinkError`."""
    return _opened("mocap", spec, options, mocap_adapters(), MocapAdapter)  # type: ignore[type-abstract]


def check_specs(agv: str, mocap: str) -> None:
    """Raise `LinkError` unless there are adapters of these names; nothing is opened."""
    _named("agv", agv, agv_adapters(), AgvAdapter)  # type: ignore[type-abstract]
    _named("mocap", mocap, mocap_adapters(), MocapAdapter)  # type: ignore[type-abstract]


def _opened(
    role: str, spec: str, options: AdapterOptions, known: dict[str, type[_Adapter]], base: type[_Adapter]
) -> _Adapter:
    scheme, address = parse_spec(spec)
    adapter = _named(role, spec, known, base)
    return open_own(adapter, scheme, address, options) if is_file(scheme) else adapter.open(address, options)


def _named(role: str, spec: str, known: dict[str, type[_Adapter]], base: type[_Adapter]) -> type[_Adapter]:
    scheme, _ = parse_spec(spec)
    return own_adapter(scheme, base) if is_file(scheme) else _choose(role, scheme, known)


def _choose(role: str, scheme: str, known: dict[str, type[_Adapter]]) -> type[_Adapter]:
    if scheme in known:
        return known[scheme]
    close = difflib.get_close_matches(scheme, known, n=1)
    raise LinkError(
        f"no such {role} adapter",
        value=repr(scheme),
        limit=" ".join(known),
        remedy=f"did you mean '{close[0]}'?" if close else "write SCHEME or SCHEME:ADDRESS",
    )
