"""Python files that a lab adds: those of a folder of the current folder that import one of agvbench's packages.

Files of other projects' folders of this name are not executed, and nothing in a campaign directory is: a campaign may
come from another lab. The log says which files were loaded; without a configuration of logging, on stderr.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
import traceback
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from agvbench.errors import FileError

_CAMPAIGN = "campaign.toml"


@dataclass(frozen=True)
class OwnModules:
    """The files of ``./folder`` that mention `package`.

    Parameters
    ----------
    folder
        Relative to the current folder.
    package
        Of agvbench; a file is one of these if its text mentions it.
    imported_as
        The name of the package as which the files are imported, so that compiled code can refer to them.
    how_to
        The page that explains such a file.
    """

    folder: str
    package: str
    imported_as: str
    how_to: str

    def files(self) -> list[Path]:
        """Return the files, relative to the current folder, in alphabetical order."""
        folder = Path(self.folder)
        if not folder.is_dir() or _in_campaign(Path.cwd()) or folder.resolve().is_relative_to(Path(__file__).parent):
            return []
        return [file for file in sorted(folder.glob("*.py")) if file.stem.isidentifier() and self._is_one(file)]

    def load(self) -> list[ModuleType]:
        """Import the files, log their names, and return the modules.

        Raises
        ------
        Exception
            Whatever the import of a file raises; `import_error` makes an error of it.
        """
        files = self.files()
        if not files:
            return []
        logging.getLogger(__name__).warning("own %s: %s", self.folder, ", ".join(map(str, files)))
        spec = ModuleSpec(self.imported_as, None, is_package=True)
        spec.submodule_search_locations = [str(Path(self.folder).resolve())]
        sys.modules[self.imported_as] = importlib.util.module_from_spec(spec)
        return [importlib.import_module(f"{self.imported_as}.{file.stem}") for file in files]

    def import_error(self, error: Exception, shipped: Path) -> FileError:
        """Return the error of a file, of these or in the folder `shipped`, that cannot be imported: path and line."""
        folders = {shipped, Path(self.folder).absolute()}
        if isinstance(error, SyntaxError):
            file, line, what = error.filename or "", error.lineno, error.msg
        else:
            frames = traceback.extract_tb(error.__traceback__)
            own = [frame for frame in frames if folders & {*Path(frame.filename).parents}] or [frames[-1]]
            file, line, what = own[-1].filename, own[-1].lineno, f"{type(error).__name__} {error}"
        where, remedy = f"{shown_file(file)}:{line}", f"correct it; see {self.how_to}"
        return FileError("cannot be imported", where=where, value=what, remedy=remedy)

    def _is_one(self, file: Path) -> bool:
        return self.package in file.read_text(encoding="utf-8", errors="replace")


def shown_file(file: str) -> str:
    """Return a path, from the current folder where it lies in it."""
    path, here = Path(file), Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def _in_campaign(folder: Path) -> bool:
    return any((parent / _CAMPAIGN).exists() for parent in (folder, *folder.parents))
