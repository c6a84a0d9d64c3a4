"""Discrepancy terms: shapes for causes outside the library, simulated and fitted like effects.

They name no cause. Each declares the ``covariates`` on which the residual depends, the main one first, and the output
channel that it acts ``through``. They are parametric shapes (a disc, a line, an exponential) and not tables: a shape
has few parameters, and therefore predicts runs that it was not fitted to.
"""

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.diagnosis.terms.camera import BentPicture
from agvbench.diagnosis.terms.campaign_time import (
    ClockByCampaignTime,
    DriftByCampaignTime,
    MarkersByCampaignTime,
    SpeedByCampaignTime,
    SpeedLagByCampaignTime,
    SteeringByCampaignTime,
    SteeringLagByCampaignTime,
    TrimByCampaignTime,
    WheelsByCampaignTime,
)
from agvbench.diagnosis.terms.floor import DriftByPlace, DriftToPoint
from agvbench.diagnosis.terms.logged import (
    ByLoggedColumn,
    SpeedByLoggedColumn,
    SteeringByLoggedColumn,
    TrimByLoggedColumn,
)
from agvbench.diagnosis.terms.speed import (
    SpeedAfterSteering,
    SpeedByCourse,
    SpeedByHeading,
    SpeedByRunTime,
    SpeedBySteering,
    SpeedInDisc,
    SpeedInStrip,
)
from agvbench.diagnosis.terms.steering import (
    SteeringAtStart,
    SteeringByDirection,
    SteeringByHistory,
    SteeringBySpeed,
    SteeringByTravel,
    SteeringCreep,
)
from agvbench.diagnosis.terms.turning import (
    SlipByYawRate,
    TurnAtLine,
    TurnByDirection,
    TurnByHeading,
    TurnWhileCoasting,
    TwistAtStart,
    WaveByDistance,
)

TERMS: tuple[type[DiscrepancyTerm], ...] = (
    SpeedInDisc,
    SpeedInStrip,
    TurnAtLine,
    BentPicture,
    SpeedByHeading,
    SpeedByCourse,
    TurnByHeading,
    SlipByYawRate,
    DriftToPoint,
    DriftByPlace,
    SpeedByRunTime,
    SpeedBySteering,
    SpeedAfterSteering,
    SteeringAtStart,
    TwistAtStart,
    TurnWhileCoasting,
    SpeedByCampaignTime,
    SteeringByCampaignTime,
    TrimByCampaignTime,
    WheelsByCampaignTime,
    SteeringLagByCampaignTime,
    SpeedLagByCampaignTime,
    DriftByCampaignTime,
    MarkersByCampaignTime,
    ClockByCampaignTime,
    SpeedByLoggedColumn,
    SteeringByLoggedColumn,
    TrimByLoggedColumn,
    SteeringByDirection,
    SteeringBySpeed,
    SteeringByHistory,
    SteeringByTravel,
    SteeringCreep,
    WaveByDistance,
    TurnByDirection,
)
"""All discrepancy terms."""

__all__ = [
    "TERMS",
    "BentPicture",
    "ByLoggedColumn",
    "ClockByCampaignTime",
    "DiscrepancyTerm",
    "DriftByCampaignTime",
    "DriftByPlace",
    "DriftToPoint",
    "MarkersByCampaignTime",
    "SlipByYawRate",
    "SpeedAfterSteering",
    "SpeedByCampaignTime",
    "SpeedByCourse",
    "SpeedByHeading",
    "SpeedByLoggedColumn",
    "SpeedByRunTime",
    "SpeedBySteering",
    "SpeedInDisc",
    "SpeedInStrip",
    "SpeedLagByCampaignTime",
    "SteeringAtStart",
    "SteeringByCampaignTime",
    "SteeringByDirection",
    "SteeringByHistory",
    "SteeringByLoggedColumn",
    "SteeringBySpeed",
    "SteeringByTravel",
    "SteeringCreep",
    "SteeringLagByCampaignTime",
    "TrimByCampaignTime",
    "TrimByLoggedColumn",
    "TurnAtLine",
    "TurnByDirection",
    "TurnByHeading",
    "TurnWhileCoasting",
    "TwistAtStart",
    "WaveByDistance",
    "WheelsByCampaignTime",
]
