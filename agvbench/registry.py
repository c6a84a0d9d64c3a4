"""Find classes by file: a new effect, kind of map or adapter is one new module, and nothing else."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import TypeGuard, TypeVar

_Class = TypeVar("_Class")


def classes_by_file(package: ModuleType | str, base: type[_Class]) -> list[type[_Class]]:
    """Return every concrete subclass of `base` that a module of `package` defines, in the order of module names.

    Parameters
    ----------
    package
        The package, or its name; its modules are imported, those of packages inside it are not.
    base
        What the classes derive from; itself, and what is still abstract, is left out.

    Examples
    --------
    >>> from agvbench.errors import AgvbenchError
    >>> classes_by_file("agvbench.vehicle", AgvbenchError)
    []
    """
    module = importlib.import_module(package) if isinstance(package, str) else package
    return [cls for inside in modules_of(module) for cls in own_classes(inside, base) if not inspect.isabstract(cls)]


def classes_in_folders(package: str, base: type[_Class]) -> list[type[_Class]]:
    """Return the classes that `classes_by_file` finds in `package`, then those of each package directly inside it."""
    path = importlib.import_module(package).__path__
    inside = [info.name for info in pkgutil.iter_modules(path, f"{package}.") if info.ispkg]
    return [cls for name in (package, *inside) for cls in classes_by_file(name, base)]


def modules_of(package: ModuleType) -> Iterator[ModuleType]:
    """Import and yield the modules of `package`, in the order of their names; those of packages inside it are not."""
    for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(info.name)


def own_classes(module: ModuleType, base: type[_Class]) -> list[type[_Class]]:
    """Return every subclass of `base` that `module` itself defines, abstract ones too, in its order."""
    return [cls for cls in vars(module).values() if _is_own(cls, base, module)]


def _is_own(value: object, base: type[_Class], module: ModuleType) -> TypeGuard[type[_Class]]:
    is_derived = isinstance(value, type) and issubclass(value, base) and value is not base
    return is_derived and value.__module__ == module.__name__
