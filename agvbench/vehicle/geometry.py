"""Where the axles are, and which of them drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

from agvbench.errors import OneOf, VehicleError
from agvbench.vehicle.fields import coerce_float, require_positive

LONGEST_M = 20.0
Driven = Literal["both", "front", "rear"]
"""Which axle the motor drives."""

_FRONT_DRIVE_SHARES: Final[dict[str, float]] = {"both": 0.5, "front": 1.0, "rear": 0.0}


@dataclass(frozen=True)
class Geometry:
    """Distances along the vehicle's centre line (thesis table 5.1, l_f and l_r), and the driven axle.

    Parameters
    ----------
    front_axle_m
        From the marker centroid forward to the front axle [m].
    rear_axle_m
        From the marker centroid backward to the rear axle [m].
    driven
        The driven axle. With one, the other rolls: the drive's speed is that of the driven axle alone.

    Raises
    ------
    VehicleError
        Unless both distances are finite, greater than zero and at most 20 m, or if `driven` is unknown.

    Examples
    --------
    >>> Geometry(front_axle_m=0.181, rear_axle_m=0.121).wheelbase_m
    0.302
    """

    front_axle_m: float
    rear_axle_m: float
    driven: Driven = "both"

    def __post_init__(self) -> None:
        coerce_float(self, "front_axle_m", "rear_axle_m")
        require_positive(self, "front_axle_m", "rear_axle_m")
        for name in ("front_axle_m", "rear_axle_m"):
            if (value := getattr(self, name)) > LONGEST_M:
                raise VehicleError(
                    f"{name} is longer than any vehicle",
                    value=f"{value:g} m",
                    limit=f"at most {LONGEST_M:g} m",
                    remedy="give metres",
                )
        if self.driven not in get_args(Driven):
            raise VehicleError(
                "unknown driven axle", where="driven", value=repr(self.driven), limit=OneOf(get_args(Driven))
            )

    @property
    def wheelbase_m(self) -> float:
        """Distance from axle to axle [m]."""
        return self.front_axle_m + self.rear_axle_m

    @property
    def front_drive_share(self) -> float:
        """Weight of the front axle's speed in the body's: 0.5 if both axles drive, 1 or 0 if one does."""
        return _FRONT_DRIVE_SHARES[self.driven]
