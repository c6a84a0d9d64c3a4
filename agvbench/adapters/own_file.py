"""``FILE.py`` and ``FILE.py:ADDRESS``: an adapter from a file of one's own, which need not be installed."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TypeVar

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter
from agvbench.errors import AgvbenchError, LinkError
from agvbench.registry import own_classes
from agvbench.simulator.checked_plant import explain
from agvbench.simulator.plant_loading import import_file

_Adapter = TypeVar("_Adapter", AgvAdapter, MocapAdapter)


def is_file(scheme: str) -> bool:
    """Whether what stands before the first colon names a file.

    >>> is_file("lab/vicon.py"), is_file("natnet")
    (True, False)
    """
    return scheme.endswith(".py")


def own_adapter(path: str, base: type[_Adapter]) -> type[_Adapter]:
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
        raise _told(error, path) from error
    own = own_classes(module, base)
    whole = [cls for cls in own if not inspect.isabstract(cls)]
    if len(whole) != 1:
        raise _not_one(path, own, whole, base)
    (adapter,) = whole
    if not hasattr(adapter, "scheme"):
        adapter.scheme = Path(path).stem
    return adapter


def open_own(adapter: type[_Adapter], path: str, address: str, options: AdapterOptions) -> _Adapter:
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
        raise _told(error, path) from error
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


def _told(error: BaseException, path: str) -> LinkError:
    said = error if isinstance(error, AgvbenchError) else explain(error, path)
    return LinkError(said.what, where=said.where, value=said.value, limit=said.limit, remedy=said.remedy)
