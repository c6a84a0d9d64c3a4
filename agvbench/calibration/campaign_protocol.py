"""The protocol of a campaign for calibration: its header and its runs, wherever they are kept."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from agvbench.types import Command, Run
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry


class HeaderLike(Protocol):
    """What holds for all runs; `agvbench.campaign.CampaignHeader` is one."""

    @property
    def name(self) -> str:
        """Name of the campaign."""

    @property
    def vehicle_name(self) -> str:
        """Name of the vehicle."""

    @property
    def geometry(self) -> Geometry:
        """Where the axles are, and which of them drives."""

    @property
    def channels(self) -> Channels:
        """Units, neutral commands and ranges of the command channels."""

    @property
    def neutral(self) -> Command:
        """Command at which the vehicle stands and steers straight."""

    @property
    def mocap_rate_hz(self) -> float:
        """Frame rate of the camera [Hz]."""

    @property
    def prediction_horizon_s(self) -> float | None:
        """How far ahead free driving is predicted [s]; None where runs begin at rest."""

    @property
    def prediction_stride_s(self) -> float | None:
        """From one prediction to the next [s]; the horizon where None."""


class CampaignLike(Protocol):
    """A header and runs in order; `agvbench.campaign.Campaign` is one."""

    @property
    def header(self) -> HeaderLike:
        """What holds for all runs."""

    def __iter__(self) -> Iterator[Run]:
        """Iterate over all runs, by time of start."""
