"""The vehicle of chapters 6, 7 and appendix B: what its axles and its drive really do with a pulse."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from agvbench.model import thesis_vehicle
from agvbench.thesis.prediction.assumptions import Assumptions, TrueDrive
from agvbench.thesis.refits.cornering import NEUTRAL_US, cornering_share, fitted_loss
from agvbench.thesis.refits.drive import dead_band_map
from agvbench.thesis.refits.steering import true_maps, verification_maps
from agvbench.thesis.tables import GEOMETRY
from agvbench.vehicle.kinematics import body_motion


class SteadyMotion(NamedTuple):
    """How the markers move per metre that the same drive goes at 1500 µs of steering."""

    speed: float
    sideslip_rad: float
    yaw_per_m: float


@cache
def true_speed(drive_us: float, kind: TrueDrive = "measured") -> float:
    """Return the speed [m/s] at a drive pulse and 1500 µs of steering: the shipped vehicle's, from table 7.4.

    ``"dead_band"`` takes the dead band with saturation fitted to the same table; at full command the two agree.
    """
    return float(thesis_vehicle().speed(drive_us) if kind == "measured" else dead_band_map()(drive_us))


def steady_motion(front_us: float, rear_us: float, condition: str, assumed: Assumptions) -> SteadyMotion:
    """Return the motion at two steering pulses."""
    before = condition == "uncalibrated" and assumed.uncalibrated_steering == "table_6_1"
    kind = "table_6_1" if before else assumed.true_steering
    return _steady_motion(front_us, rear_us, kind, assumed.cornering_loss == "appendix_b")


@cache
def _steady_motion(front_us: float, rear_us: float, kind: str, with_loss: bool) -> SteadyMotion:
    loss = fitted_loss() if with_loss else 0.0
    front, rear = _angles(kind, front_us, rear_us)
    speed, sideslip, yaw_rate = (float(x) for x in body_motion(front, rear, 1.0, 1.0, GEOMETRY))
    # Table 7.4 was driven at 1500 µs, so that is where the drive goes exactly as far as the table says.
    kept = float(cornering_share(front, rear, loss)) / _neutral_share(kind, loss)
    return SteadyMotion(kept * speed, sideslip, kept * yaw_rate)


def _angles(kind: str, front_us: float, rear_us: float) -> tuple[float, float]:
    front, rear = verification_maps() if kind == "table_6_1" else true_maps(kind)
    return float(front(front_us)), float(rear(rear_us))


@cache
def _neutral_share(kind: str, loss: float) -> float:
    front, rear = _angles(kind, NEUTRAL_US, NEUTRAL_US)
    speed, _, _ = body_motion(front, rear, 1.0, 1.0, GEOMETRY)
    return float(speed) * float(cornering_share(front, rear, loss))
