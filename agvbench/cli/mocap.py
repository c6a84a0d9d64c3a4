"""Run one motion capture adapter as its own process on the bus.

examples:
  agvbench mocap sim --connect tcp/127.0.0.1:7447      a simulated camera for the vehicle of 'agvbench agv sim'
  agvbench mocap sim --camera rate_hz=240 --camera lost=0.01
"""

from __future__ import annotations

import argparse

from agvbench.cli import _adapter_arguments as shared

HELP = "run a motion capture adapter as its own process"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("adapter", metavar="ADAPTER", help="SCHEME or SCHEME:ADDRESS, such as sim")
    shared.add_seed_argument(parser)
    shared.add_camera_arguments(parser)
    shared.add_bus_arguments(parser, shared.MOCAP_ENDPOINT)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal ends it; return the exit code."""
    return shared.run_with(arguments, shared.MOCAP_ENDPOINT, agv=None, mocap=arguments.adapter)
