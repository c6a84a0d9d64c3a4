"""Adapters by scheme or by file: one in ``adapters/agv/`` or ``adapters/mocap/`` is found by name.

``sim`` and ``serial:/dev/ttyACM0`` are adapter specifications: scheme, then an address behind a colon. ``vicon.py`` and
``lab/vicon.py:192.168.0.3`` name a file instead.
"""

from __future__ import annotations

import difflib
import inspect
from functools import cache
from pathlib import Path
from typing import TypeVar

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter
from agvbench.errors import AgvbenchError, LinkError, OneOf
from agvbench.registry import classes_by_file, own_classes
from agvbench.simulator.checked_plant import as_plant_error
from agvbench.simulator.plant_loading import import_file

_Adapter = TypeVar("_Adapter", AgvAdapter, MocapAdapter)


@cache
def agv_adapters() -> dict[str, type[AgvAdapter]]:
    """Return the AGV adapters by scheme."""
    return _by_scheme(classes_by_file("agvbench.adapters.agv", AgvAdapter))  # type: ignore[type-abstract]


@cache
def mocap_adapters() -> dict[str, type[MocapAdapter]]:
    """Return the mocap adapters by scheme."""
    return _by_scheme(classes_by_file("agvbench.adapters.mocap", MocapAdapter))  # type: ignore[type-abstract]


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
    return _opened(_named("agv", spec, agv_adapters(), AgvAdapter), spec, options)  # type: ignore[type-abstract]


def open_mocap(spec: str, options: AdapterOptions) -> MocapAdapter:
    """Open the mocap adapter that `spec` names.

    Raises
    ------
    AgvbenchError
        If there is none, it does not have such options, or it cannot be opened.
    """
    adapter = _named("mocap", spec, mocap_adapters(), MocapAdapter)  # type: ignore[type-abstract]
    adapter.check(parse_spec(spec)[1], options)
    return _opened(adapter, spec, options)


def check_specs(agv: str, mocap: str, options: AdapterOptions) -> None:
    """Raise `AgvbenchError` unless there are adapters of these names, the camera with these options; open nothing."""
    check_agv(agv)
    check_mocap(mocap, options)


def check_agv(spec: str) -> None:
    """Raise `LinkError` unless there is an AGV adapter of this name."""
    _named("agv", spec, agv_adapters(), AgvAdapter)  # type: ignore[type-abstract]


def check_mocap(spec: str, options: AdapterOptions) -> None:
    """Raise `AgvbenchError` unless there is a mocap adapter of this name, whose camera can have these options."""
    adapter = _named("mocap", spec, mocap_adapters(), MocapAdapter)  # type: ignore[type-abstract]
    adapter.check(parse_spec(spec)[1], options)


def _opened(adapter: type[_Adapter], spec: str, options: AdapterOptions) -> _Adapter:
    scheme, address = parse_spec(spec)
    return open_plug_in(adapter, scheme, address, options) if is_file(scheme) else adapter.open(address, options)


def _named(role: str, spec: str, known: dict[str, type[_Adapter]], base: type[_Adapter]) -> type[_Adapter]:
    scheme, _ = parse_spec(spec)
    return plug_in_adapter(scheme, base) if is_file(scheme) else _choose(role, scheme, known)


def _choose(role: str, scheme: str, known: dict[str, type[_Adapter]]) -> type[_Adapter]:
    if scheme in known:
        return known[scheme]
    close = difflib.get_close_matches(scheme, known, n=1)
    raise LinkError(
        f"no such {role} adapter",
        value=repr(scheme),
        limit=OneOf(known),
        remedy=f"did you mean '{close[0]}'?" if close else "write SCHEME or SCHEME:ADDRESS",
    )


def is_file(scheme: str) -> bool:
    """Whether what stands before the first colon names a file.

    >>> is_file("lab/vicon.py"), is_file("natnet")
    (True, False)
    """
    return scheme.endswith(".py")


def plug_in_adapter(path: str, base: type[_Adapter]) -> type[_Adapter]:
    """Return the one class derived from `base` that the file `path` defines; its ``scheme`` may be left out.

    Raises
    ------
    LinkError
        If there is no such file, it cannot be imported, or it has no such class, or several.
    """
    if not Path(path).is_file():
        raise LinkError("there is no such file", where=path, remedy="write path/to/FILE.py or path/to/FILE.py:ADDRESS")
    try:
        module = import_file(Path(path))
    except AgvbenchError as error:
        raise _adapter_error(error, path) from error
    own = own_classes(module, base)
    whole = [cls for cls in own if not inspect.isabstract(cls)]
    if len(whole) != 1:
        raise _not_one(path, own, whole, base)
    (adapter,) = whole
    if not hasattr(adapter, "scheme"):
        adapter.scheme = Path(path).stem
    return adapter


def open_plug_in(adapter: type[_Adapter], path: str, address: str, options: AdapterOptions) -> _Adapter:
    """Open an adapter of the file `path`.

    Raises
    ------
    LinkError
        If that fails; the line of the file is named.
    """
    try:
        opened: object = adapter.open(address, options)
    except AgvbenchError:
        raise
    except (Exception, SystemExit) as error:
        raise _adapter_error(error, path) from error
    if not isinstance(opened, adapter):
        remedy = f"return an instance of {adapter.__name__}"
        raise LinkError("open returned something else", where=path, value=repr(opened), remedy=remedy)
    return opened


def _not_one(path: str, own: list[type], whole: list[type], base: type) -> LinkError:
    if whole:
        names = " ".join(cls.__name__ for cls in whole)
        return LinkError(f"several {base.__name__}s", where=path, value=names, remedy="give each a file of its own")
    if own:
        missing = " ".join(sorted(getattr(own[0], "__abstractmethods__", ())))
        return LinkError(f"{own[0].__name__} lacks methods", where=path, value=missing, remedy="define them")
    return LinkError(f"no {base.__name__}", where=path, remedy=f"derive a class from agvbench.adapters.{base.__name__}")


def _adapter_error(error: BaseException, path: str) -> LinkError:
    said = error if isinstance(error, AgvbenchError) else as_plant_error(error, path)
    return LinkError(said.what, where=said.where, value=said.value, limit=said.limit, remedy=said.remedy)
