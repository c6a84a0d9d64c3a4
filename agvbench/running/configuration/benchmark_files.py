"""Benchmark files by name: ``calibration`` is bench_calibration.py beside the user, else the one shipped."""

from __future__ import annotations

from pathlib import Path

from agvbench.errors import FlagError, OneOf
from agvbench.resources import resource_directory


def find_benchmark(name: str) -> Path:
    """Return the file of a benchmark: a path, or a name found in ``benchmarks/`` here, else among those shipped.

    Raises
    ------
    FlagError
        If there is none.
    """
    if Path(name.partition("::")[0]).is_file():
        return Path(name)
    for folder in _folders():
        if (path := _file(folder, name)).is_file():
            return path
    known = sorted({p.stem.removeprefix("bench_") for folder in _folders() for p in folder.glob("bench_*.py")})
    raise FlagError("no such benchmark", value=name, limit=OneOf(known), remedy="name one of these, or a file")


def benchmark_name(file: str) -> str:
    """Return the name under which `find_benchmark` finds a file; a file that has none is its own name."""
    name = Path(file).stem.removeprefix("bench_")
    found = next((path for folder in _folders() if (path := _file(folder, name)).is_file()), None)
    return name if found is not None and found.resolve() == Path(file).resolve() else file


def _folders() -> tuple[Path, Path]:
    return Path("benchmarks"), resource_directory("benchmarks")


def _file(folder: Path, name: str) -> Path:
    return folder / f"bench_{name}.py"


EXCITATION_RUNS = ("calibration", "trajectories", "step_response", "free_driving")
"""Benchmarks that excite every effect: the last two identify lags, which steady driving hides."""
