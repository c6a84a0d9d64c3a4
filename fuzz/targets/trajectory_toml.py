"""Trajectory files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget


class TrajectoryToml(FileTarget):
    """A trajectory, read but not planned."""

    name = "trajectory_toml"
    instruments = ("tomllib", "agvbench.text_files",
                   "agvbench.planning.trajectories.loading", "agvbench.planning.trajectories.toml_errors",
                   "agvbench.planning.trajectories.trajectory", "agvbench.planning.trajectories.segments")  # fmt: skip
    suffix = ".toml"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.planning.trajectories.loading import load_trajectory

        self._load = load_trajectory

    def seeds(self) -> Iterable[bytes]:
        """Return the trajectories that ship."""
        from agvbench.planning.trajectories.loading import trajectory_files

        for path in trajectory_files():
            yield path.read_bytes()

    def read(self, path: Path) -> None:
        """Load the trajectory."""
        self._load(path)
