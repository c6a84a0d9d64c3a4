"""Build the vehicle's firmware, and the simulated microcontroller that ``--agv simavr`` runs it in.

The sources ship with agvbench. In a checkout the result is in firmware/build, as after `nox -s firmware`; otherwise in
the user's cache. agvbench doctor says whether it is there. Needs Debian's packages make gcc libc6-dev gcc-avr avr-libc
simavr libsimavr-dev.

examples:
  agvbench firmware                                        both versions and the simulated microcontroller
  agvbench firmware --calibration my.h --out my_vehicle    for the vehicle that `agvbench calibrate --firmware` wrote of
  avrdude -p m328p -c arduino -P /dev/ttyACM0 -U flash:w:my_vehicle/agv2.elf       onto an Arduino Uno
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "build the vehicle's firmware and its simulation"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--calibration", metavar="FILE.h", type=Path, help="what the vehicle says of its calibration (default: none)"
    )
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to (default: where --agv simavr looks)")


def run(arguments: argparse.Namespace) -> int:
    """Build, say what came of it, and return the exit code."""
    from agvbench.workflows.firmware_build import build_firmware

    directory, said = build_firmware(arguments.calibration, arguments.out)
    print(f"{said}\nbuilt: {directory}".strip())
    return 0
