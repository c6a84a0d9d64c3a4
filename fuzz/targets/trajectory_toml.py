"""Trajectory files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget


class TrajectoryToml(FileTarget):
    """A trajectory, read but not planned."""

    name = "trajectory_toml"
    instruments = ("tomllib", "agvbench.text_files", "agvbench.planning.reading", "agvbench.planning.validation",
                   "agvbench.planning.trajectory", "agvbench.planning.segments")  # fmt: skip
    suffix = ".toml"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.planning.reading import load_trajectory

        self._load = load_trajectory

    def seeds(self) -> Iterable[bytes]:
        """Return the trajectories that ship."""
        from agvbench.planning.reading import trajectory_files

        for path in trajectory_files():
            yield path.read_bytes()

    def read(self, path: Path) -> None:
        """Load the trajectory."""
        self._load(path)
