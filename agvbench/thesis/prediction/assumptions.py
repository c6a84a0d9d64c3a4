"""What the thesis does not state about its drives of chapter 8, and the set that is assumed before looking.

The default set follows one rule, written down before the predictor existed (docs/decisions/0001-thesis-assumptions.md):

1. what the thesis says it did, is done;
2. what it argues away (acceleration in 8.1, the list of 3.2) stays away;
3. what it measured and did not argue away (end stops, speeds, appendix B) is used;
4. where it is silent, the target must be reachable.

Every other choice is sensitivity, and a set picked because it fits chapter 8 is post hoc.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Literal, get_args, get_type_hints

Condition = Literal["uncalibrated", "calibrated"]
Steering = Literal["abeam", "front", "rear", "opposite"]
Ramps = Literal["none", "accelerate_and_brake", "with_rebound"]
Duration = Literal["path", "kinematic"]
CorneringLoss = Literal["appendix_b", "none"]
TrueSteering = Literal["end_stops", "monotone"]
TrueDrive = Literal["measured", "dead_band"]
TurnTarget = Literal["sqrt_2", "1.41"]
NominalSpeed = Literal["0.32", "table_7_4"]
WholeDegrees = Literal["none", "rounded", "toward_straight", "servo_floor"]
UncalibratedSteering = Literal["chapter_7", "table_6_1"]
CalibratedDrive = Literal["cubic", "end_of_range", "table_7_4"]
CalibratedSteering = Literal["published", "unrounded"]


@dataclass(frozen=True)
class Assumptions:
    """One answer to every question that the thesis does not answer; the defaults follow the rule of this module."""

    steering: Steering = "abeam"
    ramps: Ramps = "none"
    duration: Duration = "path"
    cornering_loss: CorneringLoss = "appendix_b"
    true_steering: TrueSteering = "end_stops"
    turn_target: TurnTarget = "sqrt_2"
    nominal_speed: NominalSpeed = "0.32"
    whole_degrees: WholeDegrees = "none"
    uncalibrated_steering: UncalibratedSteering = "chapter_7"
    true_drive: TrueDrive = "measured"
    calibrated_drive: CalibratedDrive = "cubic"
    calibrated_steering: CalibratedSteering = "published"


#: The assumptions that concern one condition only; all others concern both.
ONLY: dict[str, Condition] = {
    "nominal_speed": "uncalibrated",
    "whole_degrees": "uncalibrated",
    "uncalibrated_steering": "uncalibrated",
    "true_drive": "calibrated",
    "calibrated_drive": "calibrated",
    "calibrated_steering": "calibrated",
}

#: (assumption, choice): what it means and where the thesis speaks of it.
MEANING: dict[tuple[str, str], str] = {
    ("steering", "abeam"): "both axles steer about a centre abeam of the markers, R = 1 m",
    ("steering", "front"): "front axle only, R = 1 m at the rear axle",
    ("steering", "rear"): "rear axle only, R = 1 m at the front axle",
    ("steering", "opposite"): "equal and opposite angles, R = 1 m midway between the axles",
    ("ramps", "none"): "speed is there at once, as 3.2 and 8.1 assume",
    ("ramps", "accelerate_and_brake"): "8.1: 0.3 m/s in 0.294 s, and from 0.32 to 0.02 m/s in 0.588 s",
    ("ramps", "with_rebound"): "the same, then backward up to 0.1 m/s (8.1 gives no size; our upper bound)",
    ("duration", "path"): "time = length of the arc / speed of the drive curve (7.3)",
    ("duration", "kinematic"): "time also accounts for the speed that eq. 5.6 loses to the steering angles",
    ("cornering_loss", "appendix_b"): "loss per |tan δf| + |tan δr| fitted to appendix B",
    ("cornering_loss", "none"): "eq. 5.6 alone",
    ("true_steering", "end_stops"): "what the axles do: lines with end stops through tables 7.1, 7.2",
    ("true_steering", "monotone"): "what the axles do: the medians of tables 7.1, 7.2, interpolated",
    ("turn_target", "sqrt_2"): "Δs of a turn against √2 m",
    ("turn_target", "1.41"): "Δs of a turn against 1.41 m, as 8.2 prints it",
    ("nominal_speed", "0.32"): "uncalibrated time from ±0.32 m/s (6.4.1)",
    ("nominal_speed", "table_7_4"): "uncalibrated time from table 7.4's full speeds",
    ("whole_degrees", "none"): "the adapted program of 6.3 commands pulse widths",
    ("whole_degrees", "rounded"): "steering commands rounded to whole degrees (13.3 µs)",
    ("whole_degrees", "toward_straight"): "steering commands truncated towards straight ahead",
    ("whole_degrees", "servo_floor"): "servo degrees (90 = straight) truncated: left more, right less",
    ("uncalibrated_steering", "chapter_7"): "the axles answer as in tables 7.1, 7.2",
    ("uncalibrated_steering", "table_6_1"): "the axles answer as in table 6.1, measured before chapter 7",
    ("true_drive", "measured"): "what the drive does: table 7.4, interpolated smoothly",
    ("true_drive", "dead_band"): "what the drive does: a dead band with saturation through table 7.4",
    ("calibrated_drive", "cubic"): "pulse and time from the refitted cubic at ±0.32 and ±0.16 m/s",
    ("calibrated_drive", "end_of_range"): "pulse at the cubic's ends (1200, 1850 µs) and at table 7.4's half speed",
    ("calibrated_drive", "table_7_4"): "time from the speed that table 7.4 shows at the cubic's pulse",
    ("calibrated_steering", "published"): "pulses from eq. 7.1, 7.2 as printed",
    ("calibrated_steering", "unrounded"): "pulses from the same lines before rounding",
}


def choices(name: str) -> tuple[str, ...]:
    """Return the choices of one assumption, in order.

    >>> choices("duration")
    ('path', 'kinematic')
    """
    return get_args(get_type_hints(Assumptions)[name])


def concerning(condition: Condition) -> tuple[str, ...]:
    """Return the names of the assumptions that can change a prediction under `condition`."""
    return tuple(f.name for f in fields(Assumptions) if ONLY.get(f.name, condition) == condition)


def one_at_a_time(base: Assumptions) -> Iterator[tuple[str, str, Assumptions]]:
    """Yield (name, choice, set) for every set that differs from `base` in one assumption."""
    for f in fields(Assumptions):
        for choice in choices(f.name):
            if choice != getattr(base, f.name):
                yield f.name, choice, replace(base, **{f.name: choice})  # type: ignore[arg-type]


def every_combination(condition: Condition) -> Iterator[Assumptions]:
    """Yield every combination of the assumptions that concern `condition`."""
    names = concerning(condition)
    for values in itertools.product(*(choices(name) for name in names)):
        yield Assumptions(**dict(zip(names, values, strict=True)))  # type: ignore[arg-type]
