"""The plants that ship: the thesis' vehicle, vehicles drawn at random, and a small front-steered one.

Every constant of the thesis' vehicle says where it comes from; what the thesis does not say is "free".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from agvbench.simulator.plant_parameters import DIFFERENTIAL, TWO_AXLES, takes, varied
from agvbench.simulator.random_streams import random_stream
from agvbench.simulator.vehicle_parameters import (
    Battery,
    Body,
    DriveSide,
    Drivetrain,
    RunVariation,
    SimulatedVehicle,
    SteeringServo,
)
from agvbench.types import PlantFactory

if TYPE_CHECKING:
    from agvbench.simulator.differential import DifferentialPlant
    from agvbench.simulator.vehicle_plant import VehiclePlant

_DEG = math.pi / 180.0
Draw = Callable[[float, float], float]

_SERVO_FREQUENCY = 16.0  # rad/s, free: with the rate limit 60° take about 0.3 s, as a quarter-scale servo's do
_SERVO_DAMPING = 0.85  # free: hardly any overshoot
_SERVO_RATE = 5.0  # rad/s, free: about 60° in 0.2 s

THESIS_VEHICLE = SimulatedVehicle(
    front=SteeringServo(
        slope_rad_per_unit=-0.0861 * _DEG,  # table 7.1, line through 1100…1900 µs (two points left out at each end)
        cubic_rad_per_unit3=0.0,
        offset_rad=-1.5 * _DEG,  # tables 7.1, 7.2 at 1500 µs: medians −1.59°, −1.44°
        stop_low_rad=-41.5 * _DEG,  # table 7.1 at 2000, 2100 µs: −41.22°, −42.06°
        stop_high_rad=40.0 * _DEG,  # table 7.1 at 1000, 900 µs: 40.17°, 40.21°
        stop_compliance=0.05,  # tables 7.1, 7.2: the angle still creeps by 0…0.1 of what is asked
        natural_frequency_rad_per_s=_SERVO_FREQUENCY,
        damping_ratio=_SERVO_DAMPING,
        rate_limit_rad_per_s=_SERVO_RATE,
    ),
    rear=SteeringServo(
        slope_rad_per_unit=-0.0880 * _DEG,  # table 7.2, line through 1100…1900 µs
        cubic_rad_per_unit3=0.0,
        offset_rad=-2.15 * _DEG,  # tables 7.1, 7.2 at 1500 µs: medians −2.04°, −2.27°
        stop_low_rad=-39.2 * _DEG,  # table 7.2 at 2000, 2100 µs: −39.18°, −39.76°
        stop_high_rad=39.6 * _DEG,  # table 7.2 at 1000, 900 µs: 39.23°, 40.39°
        stop_compliance=0.05,
        natural_frequency_rad_per_s=_SERVO_FREQUENCY,
        damping_ratio=_SERVO_DAMPING,
        rate_limit_rad_per_s=_SERVO_RATE,
    ),
    # Table 7.4: each half fitted by least squares; within 3.3 mm/s forward and 6 mm/s backward.
    forward=DriveSide(
        dead_band=28.8, knee=152.0, unloaded_mps=0.4978, full_mps=0.3240,
        acceleration_mps2=1.04,  # 8.1: 0 to 0.3 m/s in 0.294 s
    ),
    backward=DriveSide(
        dead_band=53.7, knee=144.6, unloaded_mps=0.4816, full_mps=0.3243,
        acceleration_mps2=0.94,  # free: a little less than forward
    ),
    drive=Drivetrain(
        sense=-1.0,  # table 7.4: 900 µs drives forward
        stiffness_per_s=30.0,  # free: full speed is reached within 0.1 s of the end of the constant acceleration
        overrun=3.0, scrub=0.017, scrub_dry_mps=0.0027,  # appendix B, least squares over its 336 speeds
        rear_speed_ratio=1.01,  # free (thesis 9.2)
        # 8.1: 0.32 to 0.02 m/s in 0.588 s, then a short movement backward (here 3 mm).
        brake_per_s=3.2, brake_dry_mps2=0.02, windup_per_s2=2.35, windup_relaxes_s=0.5,
        backlash_m=0.012,  # free (thesis 9.2: insufficiently tightened parts)
    ),
    body=Body(
        # Table 5.1 (0.181, 0.121 m), the centroid 4 mm further back: the angle of the axle that is not steered drifts
        # by −0.0159 (table 7.1) and +0.0103 (table 7.2) per unit of the other's tangent, which a lever arm of
        # −4.8 and −3.1 mm explains.
        front_axle_m=0.185, rear_axle_m=0.117,
        marker_left_m=0.0,
        reverse_relief=0.01,  # tables 8.9, 8.10 calibrated: with the ramps, backward turns end 3…4° short
        understeer_s2_per_m2=0.0,  # 3.2: slip is negligible
    ),
    # Table 8.2: the least-squares curve 0.3143 (1 − 0.078 x^1.5); x = 1 after 29877 s at full speed.
    battery=Battery(
        capacity_ah=0.5 * 29877.0 / 3600.0,
        running_a=0.5,  # free: only its ratio to the capacity counts
        droop=0.078, shape=1.5,
    ),
    # Table 7.1 varies by up to 0.46°, quartiles 0.05…0.15° from the median; the calibrated straights' headings
    # (tables 8.3–8.6) by about 1°, their lengths by about 8 mm of 2 m.
    run_variation=RunVariation(front_rad=0.12 * _DEG, rear_rad=0.12 * _DEG, speed=0.003),
    neutral=1500.0, command_low=900.0, command_high=2100.0,  # table 5.2
    delay_frames=1.0,  # free (thesis 9.2 suspects delays in the controller)
)  # fmt: skip

SMALL_VEHICLE = SimulatedVehicle(
    front=SteeringServo(
        slope_rad_per_unit=0.42, cubic_rad_per_unit3=-0.06, offset_rad=0.02, stop_low_rad=-0.36, stop_high_rad=0.35,
        stop_compliance=0.02, natural_frequency_rad_per_s=18.0, damping_ratio=0.9, rate_limit_rad_per_s=6.0,
    ),
    rear=SteeringServo(
        slope_rad_per_unit=0.0, cubic_rad_per_unit3=0.0, offset_rad=0.0, stop_low_rad=-0.1, stop_high_rad=0.1,
        stop_compliance=0.0, natural_frequency_rad_per_s=18.0, damping_ratio=0.9, rate_limit_rad_per_s=6.0,
    ),
    forward=DriveSide(dead_band=0.08, knee=0.9, unloaded_mps=5.0, full_mps=2.5, acceleration_mps2=2.5),
    backward=DriveSide(dead_band=0.10, knee=0.9, unloaded_mps=4.5, full_mps=2.0, acceleration_mps2=2.0),
    drive=Drivetrain(
        sense=1.0, stiffness_per_s=4.0, overrun=1.5, rear_speed_ratio=1.0, scrub=0.05, scrub_dry_mps=0.0,
        brake_per_s=2.5, brake_dry_mps2=0.3, windup_per_s2=0.0, windup_relaxes_s=0.3, backlash_m=0.0,
    ),
    body=Body(
        front_axle_m=0.060, rear_axle_m=0.115, marker_left_m=0.002, reverse_relief=0.0, understeer_s2_per_m2=0.06,
    ),
    battery=Battery(capacity_ah=2.0, running_a=4.0, droop=0.15, shape=1.0),
    run_variation=RunVariation(front_rad=0.003, rear_rad=0.0, speed=0.005),
    neutral=0.0, command_low=-1.0, command_high=1.0,
    delay_frames=1.0,
)  # fmt: skip
"""A 1:10 car in normalised units, front-steered, wheelbase 0.175 m, markers 0.115 m ahead of the rear axle: the size
of the DART vehicle (Delft); every other constant is free."""


@takes(TWO_AXLES)
def make_plant(seed: int, **parameters: float | None) -> VehiclePlant:
    """Return the default plant: the thesis' vehicle. Commands in µs, 900…2100, neutral 1500.

    Here and below `parameters` replace the vehicle's own constants, under the names of
    `agvbench.simulator.plant_parameters`; None leaves the vehicle's own.
    """
    return _plant(THESIS_VEHICLE, seed, parameters)


@takes(TWO_AXLES)
def small_plant(seed: int, **parameters: float | None) -> VehiclePlant:
    """Return a small front-steered car. Commands −1…1, neutral 0; `rear` does nothing."""
    return _plant(SMALL_VEHICLE, seed, parameters)


@takes(TWO_AXLES)
def random_plant(seed: int, **parameters: float | None) -> VehiclePlant:
    """Return a vehicle drawn at random round the thesis' one; see `random_vehicle`."""
    return _plant(random_vehicle(seed), seed, parameters)


def _plant(vehicle: SimulatedVehicle, seed: int, parameters: Mapping[str, float | None]) -> VehiclePlant:
    from agvbench.simulator.vehicle_plant import VehiclePlant  # loads numba

    return VehiclePlant(varied(vehicle, TWO_AXLES, parameters), seed)


def random_vehicle(seed: int) -> SimulatedVehicle:
    """Draw a vehicle of the thesis' build, as another one of the fleet might be.

    Uniform: servo slopes −0.068…−0.098 °/µs, offsets ±4°, end stops ±35…45°, servo bandwidth 15…40 rad/s; full speed
    0.27…0.38 m/s (backward within 5 % of forward), dead bands 15…60 µs, knee 100…220 µs, acceleration 0.8…1.5 m/s²,
    rear against front wheels ±3 %; braking rate 2…4 /s; overrun 1…3.5, scrub 0…0.04; marker centroid ±5 mm along
    and across; relief in reverse 0…0.05; battery droop 0.04…0.12; play 0.05…0.25° and 0.1…0.6 %; delay 0…3 frames.
    """
    rng = random_stream(0xA6F, seed)

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    base = THESIS_VEHICLE
    full = draw(0.27, 0.38)
    lever = draw(-0.005, 0.005)
    return replace(
        base,
        front=_random_steering(base.front, draw),
        rear=_random_steering(base.rear, draw),
        forward=_random_side(full, draw),
        backward=_random_side(full * draw(0.95, 1.05), draw),
        drive=replace(
            base.drive, rear_speed_ratio=draw(0.97, 1.03), overrun=draw(1.0, 3.5), scrub=draw(0.0, 0.04),
            scrub_dry_mps=draw(0.0, 0.004), brake_per_s=draw(2.0, 4.0), windup_per_s2=draw(0.0, 3.0),
            backlash_m=draw(0.0, 0.02),
        ),
        body=replace(
            base.body, front_axle_m=0.181 - lever, rear_axle_m=0.121 + lever, marker_left_m=draw(-0.005, 0.005),
            reverse_relief=draw(0.0, 0.05),
        ),
        battery=replace(base.battery, droop=draw(0.04, 0.12)),
        run_variation=RunVariation(draw(0.05, 0.25) * _DEG, draw(0.05, 0.25) * _DEG, draw(0.001, 0.006)),
        delay_frames=float(rng.integers(4)),
    )  # fmt: skip


def _random_steering(base: SteeringServo, draw: Draw) -> SteeringServo:
    return replace(
        base, slope_rad_per_unit=-draw(0.068, 0.098) * _DEG, offset_rad=draw(-4.0, 4.0) * _DEG,
        stop_low_rad=-draw(35.0, 45.0) * _DEG, stop_high_rad=draw(35.0, 45.0) * _DEG, stop_compliance=draw(0.0, 0.1),
        natural_frequency_rad_per_s=draw(15.0, 40.0), damping_ratio=draw(0.6, 1.0),
    )  # fmt: skip


def _random_side(full_mps: float, draw: Draw) -> DriveSide:
    """Return a side whose map reaches full speed 280…400 µs from neutral."""
    dead_band, knee = draw(15.0, 60.0), draw(100.0, 220.0)
    reach = draw(280.0, 400.0) - dead_band
    return DriveSide(dead_band, knee, full_mps * (reach + knee) / reach, full_mps, draw(0.8, 1.5))


@takes(DIFFERENTIAL)
def differential_plant(seed: int, **parameters: float | None) -> DifferentialPlant:
    """Return a small robot with two driven wheels. `drive` is a speed [m/s], `front` a yaw rate [rad/s]."""
    from agvbench.simulator.differential import DifferentialPlant, DifferentialVehicle  # loads numba

    return DifferentialPlant(varied(DifferentialVehicle(), DIFFERENTIAL, parameters), seed)


@takes(DIFFERENTIAL)
def random_differential_plant(seed: int, **parameters: float | None) -> DifferentialPlant:
    """Return a differential vehicle drawn at random; see `agvbench.simulator.differential.random_differential`."""
    from agvbench.simulator.differential import DifferentialPlant, random_differential

    return DifferentialPlant(varied(random_differential(seed), DIFFERENTIAL, parameters), seed)


PLANTS: Mapping[str, PlantFactory] = MappingProxyType(
    {
        "make_plant": make_plant,
        "random_plant": random_plant,
        "small_plant": small_plant,
        "differential_plant": differential_plant,
        "random_differential_plant": random_differential_plant,
    }
)
"""Every plant that ships, by name: each inherits the whole contract (`agvbench.simulator.plant_contract`)."""
