"""Wrong values of a bench's options, before what drives is imported: that takes seconds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agvbench.running.configuration.settings import BenchSettings

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
    if not settings.connect:
        _check_adapters(settings, resumed=bool(options.get("resume")))
    Workspace.parse(settings.workspace)
    for name in driven_trajectories(settings.trajectories) if settings.trajectories else ():
        load_trajectory(name)
    for name in _FILES:
        path = getattr(settings, name)
        if path and not Path(path).is_file():
            from agvbench.model import VehicleModel

            VehicleModel.load(path)


def _check_adapters(settings: BenchSettings, *, resumed: bool) -> None:
    """Check schemes and the camera's options; files of one's own are run later, and only once.

    A session that is resumed may have begun with another camera than the one that is usual.
    """
    from agvbench.adapters.contract import AdapterOptions, camera_options
    from agvbench.adapters.registry import check_agv, check_mocap, is_file, parse_spec

    camera = camera_options([settings.camera])
    options = AdapterOptions(vehicle=settings.vehicle_name, camera={} if resumed else camera)
    if not is_file(parse_spec(settings.agv)[0]):
        check_agv(settings.agv)
    if not is_file(parse_spec(settings.mocap)[0]):
        check_mocap(settings.mocap, options)
