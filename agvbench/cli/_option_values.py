"""Wrong values of a bench's options, before what drives is imported: that takes seconds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

_FILES = ("vehicle", "calibration", "corrected")


def check_values(options: Mapping[str, Any]) -> None:
    """Refuse values that can be seen to be wrong without opening anything.

    Raises
    ------
    AgvbenchError
        If a value cannot be used, or a vehicle file or a trajectory is not there.
    """
    from agvbench.planning.trajectories.loading import driven_trajectories, load_trajectory
    from agvbench.planning.workspace import Workspace
    from agvbench.running.configuration.settings import BenchSettings

    settings = BenchSettings.given({name: value for name, value in options.items() if value is not None})
    Workspace.parse(settings.workspace)
    for name in driven_trajectories(settings.trajectories) if settings.trajectories else ():
        load_trajectory(name)
    for name in _FILES:
        path = getattr(settings, name)
        if path and not Path(path).is_file():
            from agvbench.model import VehicleModel

            VehicleModel.load(path)
