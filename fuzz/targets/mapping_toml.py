"""Mappings of foreign recordings."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget


class MappingToml(FileTarget):
    """A mapping file."""

    name = "mapping_toml"
    instruments = ("tomllib", "agvbench.text_files", "agvbench.campaign")
    suffix = ".toml"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.campaign.recordings.mapping import load_mapping

        self._load = load_mapping

    def seeds(self) -> Iterable[bytes]:
        """Return the mapping that ships."""
        from agvbench.campaign.recordings.mapping import find_mapping

        yield find_mapping("dart").read_bytes()

    def read(self, path: Path) -> None:
        """Load the mapping."""
        self._load(path)
