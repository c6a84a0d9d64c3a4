"""Run one AGV adapter as its own process on the bus.

The vehicle is stopped when the process ends, and when no command has arrived for half a second.

examples:
  agvbench agv sim                                     a simulated vehicle, on tcp/127.0.0.1:7447
  agvbench mocap sim --connect tcp/127.0.0.1:7447      a camera that sees it, in another terminal
  agvbench bench --connect tcp/127.0.0.1:7447          drive it, in a third
  agvbench agv serial:/dev/ttyACM0                     a vehicle with the project's firmware
  agvbench agv simavr                                  that firmware in a simulated microcontroller, driving a plant
  agvbench agv simavr-live:1                           its first version, by the clock on the wall
  agvbench agv sim:my_plant.py:make_plant --vehicle-name small_one
  agvbench agv my_lab.py:192.168.0.20:5005 --check     whether an adapter of your own keeps the contract; nothing moves
"""

from __future__ import annotations

import argparse

from agvbench.cli import _adapter_arguments as shared

HELP = "run an AGV adapter as its own process, or check it"
PACKAGES = ("zenoh",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("adapter", metavar="ADAPTER", help="SCHEME[:ADDRESS], such as sim, or FILE.py[:ADDRESS]")
    shared.add_check_argument(parser, "without moving the vehicle")
    shared.add_seed_argument(parser)
    shared.add_vehicle_arguments(parser)
    shared.add_bus_arguments(parser, shared.AGV_ENDPOINT)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal ends it, or check the adapter; return the exit code."""
    options = shared.vehicle_options(arguments)
    if arguments.check:
        from agvbench.adapters.contract_checks import check_vehicle

        return shared.print_checks(check_vehicle(arguments.adapter, shared.adapter_options(arguments, options)))
    return shared.run_with(arguments, shared.AGV_ENDPOINT, options, agv=arguments.adapter, mocap=None)
