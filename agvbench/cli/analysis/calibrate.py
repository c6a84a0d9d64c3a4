"""Fit the static maps of a vehicle from a campaign's calibration runs.

Runs of the experiments steering_front, steering_rear, steering_opposite and drive hold one command each; from the arc
that each drove follow both axle angles and the speed. For a differential vehicle drive holds straights, and yaw_rate
turns on the spot. A campaign without any, such as imported free driving, is read by short windows instead. Every fit
is printed: the thesis' line and cubic with their R², and the maps that predict better, with what was left out and why.

examples:
  agvbench calibrate campaigns/tonight                        look only
  agvbench calibrate campaigns/tonight --out calibrated.toml  keep the vehicle
  agvbench calibrate campaigns/tonight --maps thesis          the maps of the thesis, for comparison
  agvbench calibrate campaigns/tonight --firmware calibration.h   for the vehicle's firmware to say which it has
  agvbench calibrate campaigns/dart --session 2024-09-16      one day of several
"""

from __future__ import annotations

import argparse

HELP = "fit the static maps from a campaign's calibration runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("directory", metavar="DIR", help="a campaign directory")
    parser.add_argument("--out", metavar="FILE", help="write the calibrated vehicle there")
    parser.add_argument("--firmware", metavar="FILE.h", help="write the calibration's hash for the vehicle's firmware")
    parser.add_argument(
        "--maps",
        choices=("default", "thesis"),
        default="default",
        help="default: what predicts left-out commands best; thesis: lines and a cubic",
    )
    parser.add_argument("--session", metavar="NAME", help="use the runs of one session only")


def run(arguments: argparse.Namespace) -> int:
    """Calibrate; return the exit code."""
    from pathlib import Path

    from rich.console import Console

    from agvbench.reporting.console.calibration import print_calibration
    from agvbench.workflows.calibration import calibrated, save, write_firmware_header

    console, out, firmware = Console(), arguments.out, arguments.firmware
    calibration = calibrated(arguments.directory, maps=arguments.maps, session=arguments.session)
    print_calibration(calibration, console)
    if out is not None:
        save(calibration, Path(out))
    if firmware is not None:
        write_firmware_header(calibration.model, Path(firmware))
    for file in (out, firmware):
        if file is not None:
            console.print(f"{file}: calibration {calibration.model.calibration_hash}", soft_wrap=True)
    if out is None and firmware is None:
        console.print("nothing written; --out calibrated.toml writes the vehicle model with the maps marked ●")
    return 0
