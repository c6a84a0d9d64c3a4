"""`load_plant`: find a plant's factory by what the user wrote after ``--plant``."""

from __future__ import annotations

import contextlib
import difflib
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from agvbench.errors import PlantError
from agvbench.simulator.checked_plant import CheckedPlant, as_plant_error, raised
from agvbench.simulator.plant_options import plant_keywords
from agvbench.types import PlantFactory

_SAMPLED = (
    "agvbench.simulator.hidden:",
    "agvbench.simulator.hidden.differential:",
    "agvbench.simulator:random_",
    "agvbench.simulator.plants:random_",
)
_FORM = "write MODULE:FACTORY or path/to/FILE.py:FACTORY"
_NO_OPTIONS: Mapping[str, str | float] = MappingProxyType({})


class CheckedFactory:
    """A plant factory whose plants are `CheckedPlant`; ``name`` is what the user wrote.

    It is called with the keyword arguments `keywords` beside the seed.
    """

    def __init__(self, factory: PlantFactory, name: str, keywords: Mapping[str, Any] = _NO_OPTIONS) -> None:
        self._factory, self.name, self.keywords = factory, name, keywords

    def __call__(self, seed: int) -> CheckedPlant:
        """Return a plant.

        Raises
        ------
        PlantError
            If the factory raises, or returns what is no plant.
        """
        try:
            plant = self._factory(seed, **self.keywords)
        except BaseException as error:
            raise raised(error, self.name) from error
        return CheckedPlant(plant, self.name)


def load_plant(spec: str, options: Mapping[str, str | float] = _NO_OPTIONS) -> CheckedFactory:
    """Return the factory that `spec` names, its plants checked.

    Parameters
    ----------
    spec
        ``"package.module:factory"`` or ``"path/to/file.py:factory"``. The factory is called with a seed and returns a
        plant (`agvbench.types.Plant`). A file may import its neighbours, a module may lie in the working directory.
    options
        Keyword arguments of the factory, by name, as texts or numbers (`agvbench.simulator.plant_options`).

    Raises
    ------
    PlantError
        If the form is wrong, the file or module is missing or fails on import, or the attribute is missing or cannot
        be called.
    FlagError
        If the factory has no such option, or an option's value is not of its type.

    Examples
    --------
    >>> plant = load_plant("agvbench.simulator:make_plant")(seed=0)
    >>> plant.reset((1.0, 2.0, 0.0), seed=1)
    >>> plant.advance(1500.0, 1500.0, 1500.0, 1.0)
    (1.0, 2.0, 0.0)
    >>> load_plant("agvbench.simulator:make_plan")
    Traceback (most recent call last):
    agvbench.errors.PlantError: agvbench.simulator has no 'make_plan'; did you mean 'make_plant'?
    """
    source, separator, attribute = spec.rpartition(":")
    if not (separator and source and attribute.isidentifier()):
        raise PlantError("plant is not named", value=repr(spec), remedy=_FORM)
    is_file = source.endswith(".py") or "/" in source or "\\" in source
    module = import_file(Path(source)) if is_file else _import_module(source)
    factory = getattr(module, attribute, None)
    if factory is None:
        raise PlantError(f"{source} has no '{attribute}'", remedy=_suggestion(module, attribute))
    if not callable(factory):
        raise PlantError(
            f"factory cannot be called, it is of type {type(factory).__name__}", where=spec,
            remedy="name a function of a seed that returns a plant",
        )  # fmt: skip
    return CheckedFactory(factory, spec, plant_keywords(factory, options, spec))


def seed_samples_vehicle(spec: str) -> bool:
    """Return whether the plant that `spec` names ships with agvbench and is another vehicle for each seed.

    Of a plant of your own nothing is known.

    >>> seed_samples_vehicle("agvbench.simulator.hidden:steering_lag"), seed_samples_vehicle("my_plant.py:make_plant")
    (True, False)
    """
    return spec.startswith(_SAMPLED)


def _suggestion(module: ModuleType, attribute: str) -> str:
    names = [name for name in dir(module) if callable(getattr(module, name)) and not name.startswith("_")]
    close = difflib.get_close_matches(attribute, names, n=1)
    return f"did you mean '{close[0]}'?" if close else "define a function of a seed that returns a plant"


def _import_module(name: str) -> ModuleType:
    if not all(part.isidentifier() for part in name.split(".")):
        raise PlantError("plant's module is not a module name", value=repr(name), remedy=_FORM)
    with _on_path(Path.cwd()):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
                raise PlantError(
                    "there is no such module",
                    where=name,
                    remedy="install it, or run where it lies",
                ) from error
            raise as_plant_error(error, name) from error
        except (Exception, SystemExit) as error:
            raise as_plant_error(error, name) from error


def import_file(path: Path) -> ModuleType:
    """Return the module in the file `path`, which may import its neighbours.

    Raises
    ------
    PlantError
        If the file is missing or fails on import.
    """
    if not path.is_file():
        raise PlantError("there is no such file", where=path, remedy=_FORM)
    name = f"agvbench_own_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    if spec is None or spec.loader is None:
        raise PlantError("plant's file is not Python", where=path, limit="a name that ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickles look their module up
    with _on_path(path.resolve().parent):
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[name]
            raise as_plant_error(error, str(path)) from error
    return module


@contextlib.contextmanager
def _on_path(directory: Path) -> Iterator[None]:
    """Let `directory` be imported from for a while."""
    entry = str(directory)
    if entry in sys.path:
        yield
        return
    sys.path.insert(0, entry)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(entry)
