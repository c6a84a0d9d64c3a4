"""`VehiclePlant`: a simulated vehicle behind the plant protocol."""

from __future__ import annotations

import numpy as np

from agvbench.simulator import dynamics
from agvbench.simulator.checked_plant import checked_advance, checked_delay, checked_pose
from agvbench.simulator.random_streams import random_stream
from agvbench.simulator.vehicle_parameters import MAX_DELAY_FRAMES, SimulatedVehicle


class VehiclePlant:
    """A simulated vehicle.

    Commands beyond the servos' range are clipped, as a servo does; what is no finite number is an error. Equal
    calls give equal poses bit for bit. The heading is continuous over full turns.

    Parameters
    ----------
    vehicle
        Its constants.
    seed
        Seeds, together with the seed of each reset, the play of every run.

    Examples
    --------
    >>> from agvbench.simulator import make_plant
    >>> plant = make_plant(0)
    >>> plant.reset((0.0, 0.0, 0.0), seed=1)
    >>> x, y, heading = plant.advance(900.0, 1500.0, 1500.0, 6.25)
    >>> 1.8 < x < 2.1
    True
    """

    def __init__(self, vehicle: SimulatedVehicle, seed: int) -> None:
        checked_delay(vehicle.delay_frames, MAX_DELAY_FRAMES)
        self.vehicle = vehicle
        self._seed = seed
        self._constants = vehicle.pack()
        self._state = np.zeros(dynamics.STATE_SIZE)
        self._counters = np.zeros(2, dtype=np.int64)
        self._run_variation = np.zeros(3)
        self._work = np.empty((3, dynamics.MOVING))
        self._pose = (0.0, 0.0, 0.0)
        self.reset(self._pose, seed=0)

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put the vehicle at rest at `pose`, steering centred; the battery stays as it is.

        Raises
        ------
        PlantError
            If the pose is not finite.
        """
        x, y, heading = checked_pose(pose)
        rng = random_stream(self._seed, seed)
        run_variation = self.vehicle.run_variation
        self._run_variation[:] = rng.standard_normal(3) * (
            run_variation.front_rad,
            run_variation.rear_rad,
            run_variation.speed,
        )
        self._counters[:] = rng.integers(dynamics.FRAME_STEPS), 0
        charge = self._state[dynamics.CHARGE]
        self._state[:] = 0.0
        self._state[dynamics.X : dynamics.HEADING + 1] = self._pose = (x, y, heading)
        self._state[dynamics.CHARGE] = charge
        for servo, base in ((dynamics.FRONT_ANGLE, dynamics.FRONT), (dynamics.REAR_ANGLE, dynamics.REAR)):
            centre = dynamics.servo_target(self._constants, base, 0.0)
            self._state[servo] = centre
            self._state[dynamics.AIMS + (1 if base == dynamics.FRONT else 2)] = centre

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Hold the command for `dt` seconds; return the pose of the marker centroid (m, m, rad).

        Raises
        ------
        PlantError
            If a command is not a finite number, or `dt` is negative, not finite or over a day.
        """
        drive, front, rear, dt = checked_advance(drive, front, rear, dt)
        self._pose = dynamics.advance(
            self._constants, self._run_variation, self._state, self._counters, self._work, drive, front, rear, dt
        )
        return self._pose

    def true_state(self) -> dict[str, float]:
        """Return what no camera sees, for figures: speeds, servo angles [rad], drawn charge [Ah] and this run's play.

        ``x_m``, ``y_m`` and ``heading_rad`` are the pose that the last call returned; the rest is of the last grid
        point, at most 1/1200 s before.
        """
        state = dict(zip(dynamics.STATE_NAMES, map(float, self._state), strict=False))
        state["x_m"], state["y_m"], state["heading_rad"] = self._pose
        names = ("play_front_rad", "play_rear_rad", "play_speed")
        return state | dict(zip(names, map(float, self._run_variation), strict=True))
