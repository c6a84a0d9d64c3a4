"""The kind of kinematics, where the axles are, and which of them drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

from agvbench.errors import OneOf, VehicleError
from agvbench.types import Kinematics
from agvbench.vehicle.fields import coerce_float, require_positive

LONGEST_M = 20.0
Driven = Literal["both", "front", "rear"]
"""Which axle the motor drives."""

_FRONT_DRIVE_SHARES: Final[dict[str, float]] = {"both": 0.5, "front": 1.0, "rear": 0.0}


@dataclass(frozen=True)
class Geometry:
    """Distances along the vehicle's centre line (thesis table 5.1, l_f and l_r), the driven axle and the kinematics.

    Parameters
    ----------
    front_axle_m
        From the marker centroid forward to the front axle [m]; zero for a differential vehicle.
    rear_axle_m
        From the marker centroid backward to the rear axle [m]. For a differential vehicle it is the axle of its driven
        wheels, or the middle of a skid-steered vehicle, about which it turns on the spot: zero, or negative if it lies
        ahead of the centroid.
    driven
        The driven axle. With one, the other rolls: the drive's speed is that of the driven axle alone.
    kinematics
        ``"two_axle"``, or ``"differential"``: commands of speed and yaw rate.

    Raises
    ------
    VehicleError
        Unless distances are finite, at most 20 m and, with two axles, greater than zero, or if a text is unknown.

    Examples
    --------
    >>> Geometry(front_axle_m=0.181, rear_axle_m=0.121).wheelbase_m
    0.302
    """

    front_axle_m: float
    rear_axle_m: float
    driven: Driven = "both"
    kinematics: Kinematics = "two_axle"

    def __post_init__(self) -> None:
        coerce_float(self, "front_axle_m", "rear_axle_m")
        self._check_texts()
        if not self.is_differential:
            require_positive(self, "front_axle_m", "rear_axle_m")
        elif self.front_axle_m != 0.0:
            raise VehicleError(
                "a differential vehicle has no front axle",
                where="front_axle_m",
                value=f"{self.front_axle_m:g} m",
                limit="0 m",
                remedy="leave it out, and give its axle as rear_axle_m",
            )
        for name in ("front_axle_m", "rear_axle_m"):
            if abs(value := getattr(self, name)) > LONGEST_M:
                raise VehicleError(
                    f"{name} is longer than any vehicle",
                    value=f"{value:g} m",
                    limit=f"at most {LONGEST_M:g} m",
                    remedy="give metres",
                )

    def _check_texts(self) -> None:
        for what, name, known in (("driven axle", "driven", Driven), ("kinematics", "kinematics", Kinematics)):
            if (value := getattr(self, name)) not in get_args(known):
                raise VehicleError(f"unknown {what}", where=name, value=repr(value), limit=OneOf(get_args(known)))

    @property
    def is_differential(self) -> bool:
        """Whether the vehicle turns by the difference of its wheels' speeds."""
        return self.kinematics == "differential"

    def require_two_axles(self, what: str, *, where: object, remedy: str) -> None:
        """Raise `VehicleError` if the vehicle is differential; `what` cannot be done for it."""
        if self.is_differential:
            raise VehicleError(
                what, where=where, value=f'kinematics = "{self.kinematics}"', limit="two_axle", remedy=remedy
            )

    @property
    def wheelbase_m(self) -> float:
        """Distance from axle to axle [m]."""
        return self.front_axle_m + self.rear_axle_m

    @property
    def front_drive_share(self) -> float:
        """Weight of the front axle's speed in the body's: 0.5 if both axles drive, 1 or 0 if one does."""
        return _FRONT_DRIVE_SHARES[self.driven]
