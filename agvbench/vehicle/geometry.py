"""Where the axles are."""

from __future__ import annotations

from dataclasses import dataclass

from agvbench.errors import VehicleError
from agvbench.vehicle.fields import coerce_float, require_positive

LONGEST_M = 20.0


@dataclass(frozen=True)
class Geometry:
    """Distances along the vehicle's centre line (thesis table 5.1, l_f and l_r).

    Parameters
    ----------
    front_axle_m
        From the marker centroid forward to the front axle [m].
    rear_axle_m
        From the marker centroid backward to the rear axle [m].

    Raises
    ------
    VehicleError
        Unless both are finite, greater than zero and at most 20 m.

    Examples
    --------
    >>> Geometry(front_axle_m=0.181, rear_axle_m=0.121).wheelbase_m
    0.302
    """

    front_axle_m: float
    rear_axle_m: float

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

    @property
    def wheelbase_m(self) -> float:
        """Distance from axle to axle [m]."""
        return self.front_axle_m + self.rear_axle_m
