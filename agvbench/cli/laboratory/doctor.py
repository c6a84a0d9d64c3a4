"""Look whether this machine is ready to drive: nothing moves.

Every check is a line with what was found and what to do about it. Adapters are opened as a bench opens them, and the
trajectories that it would drive are planned for its vehicle. The exit code is 1 if a check fails.

examples:
  agvbench doctor                                                  what a simulation needs
  agvbench doctor --agv serial:/dev/ttyACM0 --mocap natnet:192.168.0.2   the lab
  agvbench doctor --mocap natnet:192.168.0.2 --camera body=blue   a camera alone
  agvbench doctor --connect tcp/192.168.0.3:7448 --mocap           a camera alone, hosted by 'agvbench mocap' there
  agvbench doctor --vehicle car.toml --plant my_plant.py:make_plant      another vehicle than vehicle.toml here
"""

from __future__ import annotations

import argparse

from agvbench.errors import FlagError

_ON_THE_BUS = "on the bus"
HELP = "look whether vehicle, cameras and this machine are ready"
PACKAGES = ("zenoh",)
_OF_THE_RIG = (
    "--agv", "--mocap", "--camera", "--plant", "--plant-option", "--steering", "--vehicle", "--calibration",
    "--corrected", "--seed", "--place", "--workspace", "--connect", "--bus-config", "--lab", "--vehicle-name",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments: those of ``agvbench bench`` that say with what is driven."""
    from agvbench.running.configuration.session_options import OPTIONS

    for flag, keywords, text in OPTIONS:
        if flag == "--mocap":
            said = f"{text}; without ADAPTER, beside --connect: the camera on the bus, alone"
            parser.add_argument(flag, nargs="?", const=_ON_THE_BUS, help=said, **keywords)
        elif flag in _OF_THE_RIG:
            parser.add_argument(flag, help=text, **keywords)


def run(arguments: argparse.Namespace) -> int:
    """Print what every check finds; return the exit code."""
    from agvbench.adapters import AdapterOptions, check_specs
    from agvbench.adapters.contract import camera_options
    from agvbench.reporting.console.doctor import print_finding
    from agvbench.running.configuration.session_options import destination
    from agvbench.running.configuration.settings import BenchSettings
    from agvbench.running.configuration.vehicles import with_lab_vehicle
    from agvbench.workflows.doctor import FindingState, Lab, examine

    given = {destination(flag): getattr(arguments, destination(flag)) for flag in _OF_THE_RIG}
    settings = BenchSettings.given(with_lab_vehicle({k: v for k, v in given.items() if v is not None}))
    if not settings.connect:
        if settings.mocap == _ON_THE_BUS:
            raise FlagError("no camera is named", where="--mocap", remedy="add --connect ENDPOINT, or name an adapter")
        options = AdapterOptions(vehicle=settings.vehicle_name, camera=camera_options([settings.camera]))
        check_specs(settings.agv, settings.mocap, options)
    states = [print_finding(name, finding) for name, finding in examine(Lab(settings))]
    return 1 if FindingState.BAD in states else 0
