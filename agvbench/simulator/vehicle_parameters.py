"""What a simulated vehicle is made of: the constants of its servos, drive, body, battery and run-to-run variation.

The constants are those of mechanisms (a servo's bandwidth, a motor's dead band, the force that brakes),
not those of the maps and effects by which the bench describes a vehicle: the two must not share a form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass

import numpy as np

from agvbench.types import CommandUnit, Floats

PULSE_FRAME_S = 0.020
"""Servos read their pulse once per 20 ms frame: that much delay varies from run to run."""
MAX_DELAY_FRAMES = 7
"""Longest delay of a command, in whole pulse frames."""


@dataclass(frozen=True, slots=True)
class SteeringServo:
    """One steered axle: pulse → servo (second order, rate limited) → axle with compliant end stops.

    The servo aims at ``slope u + cubic u³ + offset``, u = command − neutral; counter-clockwise positive.
    Beyond an end stop it moves on by only `stop_compliance` of what was asked.
    """

    slope_rad_per_unit: float
    cubic_rad_per_unit3: float
    offset_rad: float
    stop_low_rad: float
    stop_high_rad: float
    stop_compliance: float
    natural_frequency_rad_per_s: float
    damping_ratio: float
    rate_limit_rad_per_s: float


@dataclass(frozen=True, slots=True)
class DriveSide:
    """The drive motors in one direction.

    Steady speed on a straight: ``min(full, unloaded y / (y + knee))``, y = distance of the command from neutral less
    the dead band: a chopped motor in discontinuous conduction.
    """

    dead_band: float
    knee: float
    unloaded_mps: float
    full_mps: float
    acceleration_mps2: float


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """Both motors, one per axle, and what resists them. All forces are per unit of mass.

    A powered axle pulls the body towards ``w cos δ`` with `stiffness_per_s` (limited by the acceleration of its
    side) and holds it back `overrun` times as stiffly when the body is faster: with ``overrun = 1`` and no scrub
    the two axles settle at thesis eq. 5.6. An unpowered drive brakes: viscous, dry, and by a spring that winds up
    and relaxes, which pushes the vehicle back a little after it has stopped (thesis 8.1).
    """

    sense: float
    """+1 if a rising command drives forward, −1 if a falling one does."""
    stiffness_per_s: float
    overrun: float
    rear_speed_ratio: float
    """Rear wheels' speed over the front wheels' (thesis 9.2 doubts that it is 1)."""
    scrub: float
    scrub_dry_mps: float
    """Scrub brakes as if speed fell short by (scrub U + dry) times the sum of both axles' absolute tan δ [m/s]."""
    brake_per_s: float
    brake_dry_mps2: float
    windup_per_s2: float
    windup_relaxes_s: float
    backlash_m: float
    """Slack of the drive train, closed at every start before the wheels pull."""


@dataclass(frozen=True, slots=True)
class Body:
    """True distances from the marker centroid to the axles, and how the body follows its wheels."""

    front_axle_m: float
    rear_axle_m: float
    marker_left_m: float
    reverse_relief: float
    """Share of the axle angle that compliance takes away when the wheels push backward."""
    understeer_s2_per_m2: float


@dataclass(frozen=True, slots=True)
class Battery:
    """Speed falls by ``droop x^shape``, x = drawn charge / `capacity_ah`; full driving draws `running_a`."""

    capacity_ah: float
    running_a: float
    droop: float
    shape: float


@dataclass(frozen=True, slots=True)
class RunVariation:
    """Run-to-run variation, drawn at every reset: standard deviations of axle angle and of speed."""

    front_rad: float
    rear_rad: float
    speed: float


@dataclass(frozen=True, slots=True)
class SimulatedVehicle:
    """All constants of a simulated vehicle.

    Commands are clipped to [`command_low`, `command_high`] as a servo does. A command takes effect at the next
    pulse frame, and `delay_frames` frames later.
    """

    front: SteeringServo
    rear: SteeringServo
    forward: DriveSide
    backward: DriveSide
    drive: Drivetrain
    body: Body
    battery: Battery
    run_variation: RunVariation
    neutral: float
    command_low: float
    command_high: float
    delay_frames: float

    @property
    def command_unit(self) -> CommandUnit:
        """``"us"`` or ``"normalised"``, by the size of the command range."""
        return "us" if self.command_high > 100.0 else "normalised"

    def pack(self) -> Floats:
        """Return all constants in the order of declaration, the form the integrator reads."""
        return np.array([value for _, value in flatten(self)], dtype=np.float64)


def flatten(record: object, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield (dotted name, value) of every number in a nested dataclass, in order of declaration."""
    for item in fields(record):  # type: ignore[arg-type]
        value = getattr(record, item.name)
        if is_dataclass(value):
            yield from flatten(value, f"{prefix}{item.name}.")
        else:
            yield f"{prefix}{item.name}", float(value)
