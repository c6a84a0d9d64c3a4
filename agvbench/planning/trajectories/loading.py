"""Load trajectories from TOML files: a lab's own, those that ship with agvbench, and tables from elsewhere.

A name is looked for in the directory ``trajectories`` under the current one, which is where a lab keeps its own, and
then among those that ship.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from agvbench.errors import FileError
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.resources import resource_directory
from agvbench.text_files import read_toml
from agvbench.validation import convert, suggest

THE_EIGHT = tuple(str(number) for number in range(1, 9))
"""The test trajectories of the thesis (section 8.2)."""


def load_trajectory(name_or_path: str | Path, *, directory: Path | None = None) -> Trajectory:
    """Return the trajectory in a TOML file, or the one of that name or file name.

    Parameters
    ----------
    name_or_path
        A path ending in ``.toml``, or a name: ``"5"`` or ``"5_forward_left"``.
    directory
        The only place where names are looked for; the lab's own and then those that ship if not given.

    Raises
    ------
    FileError
        If there is no such trajectory, or its file cannot be used.

    Examples
    --------
    >>> load_trajectory("5").description
    'quarter turn forward to the left, radius 1 m, full speed'
    """
    return _read(trajectory_file(name_or_path, directory=directory))


def trajectory_file(name_or_path: str | Path, *, directory: Path | None = None) -> Path:
    """Return the file that `load_trajectory` reads; raise `FileError` if there is no trajectory of that name."""
    if isinstance(name_or_path, Path) or name_or_path.endswith(".toml"):
        return Path(name_or_path)
    files = trajectory_files(directory) if directory else [*_local_files(), *_shipped_files()]
    for file in files:
        if file.stem == name_or_path:
            return file
    # The eight are called by number, with which their files begin: reading one file is enough for them.
    for file in sorted(files, key=lambda file: file.stem.split("_")[0] != name_or_path):
        if _read(file).name == name_or_path:
            return file
    raise FileError(
        f"there is no trajectory '{name_or_path}'",
        remedy=suggest(name_or_path, list(dict.fromkeys(file.stem for file in files))),
    )


def list_trajectories(directory: Path | None = None) -> list[Trajectory]:
    """Return the trajectories of `directory`, the eight first.

    If it is not given, the lab's own are listed, or, where there are none, those that ship.

    Raises
    ------
    FileError
        If one of the files cannot be used, or two have one name.
    """
    found: dict[str, Path] = {}
    trajectories = []
    for file in trajectory_files(directory):
        trajectory = _read(file)
        if trajectory.name in found:
            raise FileError(
                f"trajectory name '{trajectory.name}' is taken", where=file, remedy=f"see {found[trajectory.name].name}"
            )
        found[trajectory.name] = file
        trajectories.append(trajectory)
    return trajectories


def trajectory_files(directory: Path | None = None) -> list[Path]:
    """Return the TOML files that `list_trajectories` reads, in order of their names (numbers come first)."""
    if directory is not None:
        return sorted(directory.glob("*.toml"))
    return _local_files() or _shipped_files()


def user_trajectories() -> list[str]:
    """Return the names of the lab's own trajectories: the files under ``trajectories`` that do not ship.

    A bench drives them after the eight. They are named by their files, which are not read.
    """
    shipped = {file.stem for file in _shipped_files()}
    return [file.stem for file in _local_files() if file.stem not in shipped]


def driven_trajectories(named: str = "") -> list[str]:
    """Return what a bench drives: the names or files in `named`, commas between; else the eight and the lab's own.

    >>> driven_trajectories("figure_eight, garage")
    ['figure_eight', 'garage']
    """
    names = dict.fromkeys(name.strip() for name in named.split(","))
    return [name for name in names if name] or [*THE_EIGHT, *user_trajectories()]


def _local_files() -> list[Path]:
    return sorted(Path("trajectories").glob("*.toml"))


def _shipped_files() -> list[Path]:
    return sorted(resource_directory("trajectories").glob("*.toml"))


def trajectory_from_table(table: Mapping[str, object], *, where: str = "trajectory") -> Trajectory:
    """Return a trajectory from a table as TOML or JSON holds it; `where` begins error messages.

    Raises
    ------
    FileError
        If the table does not fit the schema: unknown or missing keys, wrong values, two shapes.
    """
    schema = table.get("schema")
    if schema != 1 or isinstance(schema, bool):
        raise FileError(
            "schema is not one this version reads",
            where=where,
            value="none given" if schema is None else repr(schema),
            limit="schema = 1",
        )
    return convert(table, Trajectory, where=where)


def _read(path: Path) -> Trajectory:
    try:
        table = read_toml(path)
    except FileNotFoundError:
        raise FileError("no such file", where=path) from None
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", where=path) from None
    except UnicodeDecodeError as error:
        raise FileError(f"is not UTF-8 text: byte {error.start}", where=path) from None
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"is not TOML: {error}", where=path) from None
    return trajectory_from_table(table, where=str(path))
