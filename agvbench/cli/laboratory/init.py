"""Lay out a lab folder to edit: vehicle, trajectories, benchmarks, noxfile.

examples:
  agvbench init lab            make the folder lab/
  cd lab && agvbench bench     drive everything in it, simulated
  agvbench init robot --kinematics differential
                               the same for a vehicle that turns by the difference of its wheels' speeds
"""

from __future__ import annotations

import argparse

HELP = "lay out a lab folder to edit: vehicle, trajectories, benchmarks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("directory", metavar="DIR", help="folder to make; it must not exist yet, or be empty")
    parser.add_argument(
        "--kinematics",
        choices=("two_axle", "differential"),
        default="two_axle",
        help="how the vehicle turns: by the angles of its axles (default), or by its wheels' speeds",
    )


def run(arguments: argparse.Namespace) -> int:
    """Make the folder; return the exit code."""
    from agvbench.workflows.init import make_lab

    for line in make_lab(arguments.directory, arguments.kinematics):
        print(line)
    return 0
