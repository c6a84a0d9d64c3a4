"""Look whether this machine is ready to drive: nothing moves.

Every check is a line with what was found and what to do about it. The exit code is 1 if one of them fails.

examples:
  agvbench doctor                                                  what a simulation needs
  agvbench doctor --agv serial:/dev/ttyACM0 --mocap natnet:192.168.0.2   the lab
  agvbench doctor --mocap natnet:192.168.0.2 --camera body=blue
"""

from __future__ import annotations

import argparse

from agvbench.cli import _adapter_arguments as shared

HELP = "look whether vehicle, cameras and this machine are ready"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--agv", default="sim", metavar="ADAPTER", help="as for the bench (default: %(default)s)")
    parser.add_argument("--mocap", default="sim", metavar="ADAPTER", help="as for the bench (default: %(default)s)")
    parser.add_argument("--vehicle", default="agv1", help="name of the vehicle on the bus (default: %(default)s)")
    parser.add_argument(
        "--workspace", default="circle:6.1", metavar="SHAPE", help="floor to drive on (default: %(default)s m)"
    )
    parser.add_argument("--bus-config", default="", metavar="FILE", help="certificates and rules of a secured bus")
    shared.add_camera_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what every check finds; return the exit code."""
    from agvbench.adapters import check_specs
    from agvbench.adapters.camera_options import camera_options
    from agvbench.reporting.doctor_table import tell
    from agvbench.workflows.doctor import Lab, State, examine

    check_specs(arguments.agv, arguments.mocap)
    camera = camera_options(arguments.camera)
    lab = Lab(
        arguments.agv, arguments.mocap, camera, arguments.vehicle, arguments.workspace, bus_config=arguments.bus_config
    )
    states = [tell(name, finding) for name, finding in examine(lab)]
    return 1 if State.BAD in states else 0
