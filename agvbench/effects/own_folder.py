"""Effects of the user: the files of the folder ``effects`` in the current folder that import `agvbench.effects`.

Files of other projects' folders of this name are not executed, and nothing in a campaign directory is: a campaign may
come from another lab. The log says which files were loaded; without a configuration of logging, on stderr.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

from agvbench.effects.base import Effect
from agvbench.registry import own_classes

FOLDER = "effects"
PACKAGE = "agvbench_own_effects"
"""The name under which the files are imported, so that compiled code can refer to them."""
_MARK = "agvbench.effects"
_CAMPAIGN = "campaign.toml"


def own_files() -> list[Path]:
    """Return the files of effects in ``./effects``, relative to the current folder, in alphabetical order."""
    folder = Path(FOLDER)
    if not folder.is_dir() or folder.samefile(Path(__file__).parent) or _in_campaign(Path.cwd()):
        return []
    return [file for file in sorted(folder.glob("*.py")) if file.stem.isidentifier() and _is_effect(file)]


def own_effects() -> list[type[Effect]]:
    """Import the files of ``./effects``, log their names, and return the effects' classes.

    Raises
    ------
    Exception
        Whatever the import of a file raises.
    """
    files = own_files()
    if not files:
        return []
    logging.getLogger(__name__).warning("own effects: %s", ", ".join(map(str, files)))
    _make_package(Path(FOLDER).resolve())
    modules = [importlib.import_module(f"{PACKAGE}.{file.stem}") for file in files]
    return [cls for module in modules for cls in own_classes(module, Effect)]


def _in_campaign(folder: Path) -> bool:
    return any((parent / _CAMPAIGN).exists() for parent in (folder, *folder.parents))


def _is_effect(file: Path) -> bool:
    return _MARK in file.read_text(encoding="utf-8", errors="replace")


def _make_package(folder: Path) -> None:
    """Register a namespace package whose modules are the files of `folder`."""
    spec = ModuleSpec(PACKAGE, None, is_package=True)
    spec.submodule_search_locations = [str(folder)]
    sys.modules[PACKAGE] = importlib.util.module_from_spec(spec)
