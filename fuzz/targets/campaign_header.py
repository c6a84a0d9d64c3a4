"""The head of a campaign."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget

_EXAMPLE = b"""schema = 1
name = "tonight"
[vehicle]
name = "agv1"
front_axle_m = 0.1
rear_axle_m = 0.1
command_unit = "us"
neutral = 1500.0
[mocap]
rate_hz = 240.0
[prediction]
horizon_s = 1.0
stride_s = 0.5
"""


class CampaignHead(FileTarget):
    """A campaign.toml."""

    name = "campaign_header"
    instruments = ("tomllib", "agvbench.text_files", "agvbench.campaign")
    suffix = ".toml"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.campaign.header import CampaignHeader

        self._load = CampaignHeader.load

    def seeds(self) -> Iterable[bytes]:
        """Return a header with everything in it."""
        yield _EXAMPLE

    def read(self, path: Path) -> None:
        """Load the header."""
        self._load(path)
