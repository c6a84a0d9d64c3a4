"""Vehicle files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget


class VehicleToml(FileTarget):
    """A vehicle.toml."""

    name = "vehicle_toml"
    instruments = ("tomllib", "agvbench.text_files", "agvbench.model.toml", "agvbench.vehicle", "agvbench.registry")
    suffix = ".toml"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.model import VehicleModel

        self._load = VehicleModel.load

    def seeds(self) -> Iterable[bytes]:
        """Return the vehicles that ship."""
        from agvbench import model

        for path in sorted((Path(model.__file__).parent / "data").glob("*.toml")):
            yield path.read_bytes()

    def read(self, path: Path) -> None:
        """Load the vehicle."""
        self._load(path)
