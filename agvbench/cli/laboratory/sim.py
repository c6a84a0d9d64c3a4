"""Run a simulated vehicle and the camera that sees it as one process on the bus.

A bench in another process, or on another machine, drives it; the campaign is the same, byte for byte, as with the
simulation inside the bench.

examples:
  agvbench sim                                         wait on tcp/127.0.0.1:7447
  agvbench bench --connect tcp/127.0.0.1:7447          drive it, in another terminal
  agvbench sim --plant my_plant.py:make_plant --seed 7
  agvbench sim --listen tcp/0.0.0.0:7447               let other machines in, on a network that you trust
"""

from __future__ import annotations

import argparse

from agvbench.cli import _adapter_arguments as shared

HELP = "run a simulated vehicle and its camera as their own process"
PACKAGES = ("numba", "zenoh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    shared.add_seed_argument(parser)
    shared.add_vehicle_arguments(parser)
    shared.add_camera_arguments(parser)
    shared.add_bus_arguments(parser, shared.AGV_ENDPOINT)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal ends it; return the exit code."""
    options = shared.vehicle_options(arguments) | shared.camera_options(arguments)
    return shared.run_with(arguments, shared.AGV_ENDPOINT, options, agv="sim", mocap="sim")
