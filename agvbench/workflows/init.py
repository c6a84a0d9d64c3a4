"""``agvbench init``: lay out a lab folder."""

from __future__ import annotations

import shutil
from pathlib import Path

from agvbench.campaign.atomic_files import made_folder
from agvbench.errors import FileError
from agvbench.model.examples import example_path
from agvbench.resources import resource_directory
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.types import Kinematics

_TEMPLATES = Path(__file__).parent / "lab"


def make_lab(directory: str | Path, kinematics: Kinematics = "two_axle") -> list[str]:
    """Make the lab folder `directory` for a vehicle with these kinematics; return lines that say what to do next.

    Raises
    ------
    FileError
        If it exists and is not empty, or cannot be written; what was written until then is removed.
    """
    root = Path(directory)
    if root.exists() and (not root.is_dir() or any(root.iterdir())):
        raise FileError("exists already and is not empty", where=root, remedy="choose another folder")
    try:
        with made_folder(root):
            _fill(root, kinematics)
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=root, remedy="choose another folder") from None
    return [f"made the lab folder {root}", f"next: cd {root} && agvbench bench --dry-run"]


def _fill(root: Path, kinematics: Kinematics) -> None:
    """Write everything into the empty folder `root`, or nothing."""
    try:
        for folder, pattern in {"benchmarks": "bench_*.py", "trajectories": "*.toml"}.items():
            _copy(resource_directory(folder), root / folder, pattern)
        shutil.copy(resource_directory("benchmarks") / "pytest.ini", root / "benchmarks" / "pytest.ini")
        if kinematics == "differential":
            shutil.copy(example_path("differential"), root / "vehicle.toml")
        else:
            uncalibrated_vehicle().save(root / "vehicle.toml")
        shutil.copy(_TEMPLATES / "README.md", root / "README.md")
        shutil.copy(_TEMPLATES / "noxfile.py.txt", root / "noxfile.py")
        shutil.copy(_TEMPLATES / "lab.toml", root / "lab.toml")
        (root / "report_sections").mkdir()
        shutil.copy(_TEMPLATES / "battery.py.txt", root / "report_sections" / "battery.py.example")
        (root / ".gitignore").write_text("campaigns/\n.nox/\n", encoding="utf-8")
    except BaseException:
        for entry in root.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        raise


def _copy(source: Path, target: Path, pattern: str) -> None:
    target.mkdir()
    for file in sorted(source.glob(pattern)):
        shutil.copy(file, target / file.name)
