"""Empirical terms: shapes for what no effect of the library explains, simulated and fitted like effects.

They name no cause. Each says on which ``covariates`` the residual depends, the first of them first, and through what.
They are shapes (a disc, a line, an exponential) and not tables, since a shape needs few numbers and so
predicts runs that it was not fitted to.
"""

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.diagnosis.terms.camera import BentPicture
from agvbench.diagnosis.terms.speed import SpeedByHeading, SpeedByRunTime, SpeedInDisc, SpeedInStrip
from agvbench.diagnosis.terms.steering import (
    SteeringByCampaignTime,
    SteeringByDirection,
    SteeringByHistory,
    TrimByCampaignTime,
)
from agvbench.diagnosis.terms.turning import TurnAtLine, TurnByHeading, TwistAtStart, WaveByDistance

TERMS: tuple[type[DiscrepancyTerm], ...] = (
    SpeedInDisc,
    SpeedInStrip,
    TurnAtLine,
    BentPicture,
    SpeedByHeading,
    TurnByHeading,
    SpeedByRunTime,
    TwistAtStart,
    SteeringByCampaignTime,
    TrimByCampaignTime,
    SteeringByDirection,
    SteeringByHistory,
    WaveByDistance,
)
"""Every shape that is tried."""

__all__ = [
    "TERMS",
    "BentPicture",
    "DiscrepancyTerm",
    "SpeedByHeading",
    "SpeedByRunTime",
    "SpeedInDisc",
    "SpeedInStrip",
    "SteeringByCampaignTime",
    "SteeringByDirection",
    "SteeringByHistory",
    "TrimByCampaignTime",
    "TurnAtLine",
    "TurnByHeading",
    "TwistAtStart",
    "WaveByDistance",
]
