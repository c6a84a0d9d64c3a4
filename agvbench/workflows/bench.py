"""``agvbench bench``: hand the benchmarks to pytest, and its verdict back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from agvbench.errors import FlagError
from agvbench.resources import resource_directory
from agvbench.running.options import OPTIONS, SESSION_OPTIONS, destination

DEFAULT = ("calibration", "trajectories")
# The command line has imported agvbench before pytest looks for plugins, which does no harm here.
_IN_PROCESS = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"


def run_benchmarks(
    names: Sequence[str], options: Mapping[str, Any], *, only: str | None = None, summary: bool = True
) -> int:
    """Run the benchmarks `names` with `options`; return the exit code of ``agvbench``.

    ``only`` chooses among them as pytest's ``-k`` does; without ``summary`` nothing is said at the end.

    Raises
    ------
    FlagError
        If a benchmark does not exist, or no run is chosen.
    """
    files = [str(find_benchmark(name)) for name in names or DEFAULT]
    arguments = [*files, "-q", "--strict-markers", "-p", "no:cacheprovider", "-W", _IN_PROCESS, *_flags(options)]
    if only:
        arguments += ["-k", only]
    if not summary:
        arguments += ["--no-summary", "-q"]
    code = pytest.main(arguments)
    if code == pytest.ExitCode.NO_TESTS_COLLECTED:
        where, value = ("-k", only) if only else ("agvbench bench", " ".join(names))
        raise FlagError("no run to drive", where=where, value=value, remedy="see what there is with --dry-run")
    return 2 if code == pytest.ExitCode.USAGE_ERROR else int(code)


def find_benchmark(name: str) -> Path:
    """Return the file of a benchmark: a path, or a name found in ``benchmarks/`` here, else among those shipped.

    Raises
    ------
    FlagError
        If there is none.
    """
    if Path(name.partition("::")[0]).is_file():
        return Path(name)
    folders = [Path("benchmarks"), resource_directory("benchmarks")]
    for folder in folders:
        if (path := folder / f"bench_{name}.py").is_file():
            return path
    known = sorted({p.stem.removeprefix("bench_") for folder in folders for p in folder.glob("bench_*.py")})
    raise FlagError("no such benchmark", value=name, limit=", ".join(known), remedy="name one of these, or a file")


def _flags(options: Mapping[str, Any]) -> list[str]:
    flags: list[str] = []
    for flag, _, _ in OPTIONS + SESSION_OPTIONS:
        value = options.get(destination(flag))
        if value is True:
            flags.append(flag)
        elif value is not None and value is not False:
            flags.append(f"{flag}={value}")
    return flags
