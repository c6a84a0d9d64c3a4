"""What a vehicle model does under the commands of one run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from agvbench.types import Commands, Floats

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel


def simulate(
    model: VehicleModel, commands: Commands, initial: ArrayLike, t_s: ArrayLike, *, started_h: float = 0.0
) -> Floats:
    """Return the poses that `model`, with its effects, has at the times `t_s`.

    Until the first command takes effect the vehicle stands at `initial` with its axles at neutral. Each command holds
    until the next one, the last one for ever.

    Parameters
    ----------
    model
        The vehicle; `VehicleModel.with_effects` adds effects.
    commands
        Commands in the vehicle's unit, such as those of a `Run` or a plan.
    initial
        Initial pose, shape (3,): x [m], y [m], heading [rad] in the floor frame; a `Pose` is one.
    t_s
        Times [s] on the commands' clock, ascending, shape (n,).
    started_h
        Hours from the beginning of the session to the run, for effects such as ``battery_droop``.

    Returns
    -------
    ndarray
        Shape (n, 3): x [m], y [m], heading [rad, not wrapped] in the floor frame, as the cameras see them.

    Raises
    ------
    InputError
        If an argument has another shape, is not finite, or times do not ascend.
    VehicleError
        If the model turns an axle beyond 89°.

    Examples
    --------
    Ten seconds straight ahead at 0.3 m/s, and the same with a motor that takes its time:

    >>> from agvbench.effects import SpeedLag
    >>> from agvbench.model import thesis_vehicle
    >>> model = thesis_vehicle()
    >>> command = model.command_for(front_rad=0.0, rear_rad=0.0, speed_mps=0.3)
    >>> ahead = Commands(np.array([0.0]), *(np.array([channel]) for channel in command))
    >>> simulate(model, ahead, (0.0, 0.0, 0.0), [0.0, 10.0])[:, 0].round(3).tolist()
    [0.0, 3.0]
    >>> slow = model.with_effects(SpeedLag(accelerate_s=0.5, brake_s=0.5))
    >>> simulate(slow, ahead, (0.0, 0.0, 0.0), [0.0, 10.0])[:, 0].round(3).tolist()
    [0.0, 2.85]
    """
    start = np.asarray(initial, dtype=np.float64).reshape(1, -1)
    (poses,) = model.rollout([commands], start, [np.asarray(t_s, dtype=np.float64)], [started_h])
    return poses
