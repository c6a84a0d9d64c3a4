"""Show what trajectories mean for a vehicle: commands, time, floor and target. Nothing drives.

examples:
  agvbench plan                              all trajectories, for vehicle.toml here, else the thesis' vehicle
  agvbench plan 5 7 --vehicle vehicle.toml   two of the eight, for yours
  agvbench plan my_turn.toml --commands      the timed commands, as CSV
  agvbench plan 5 --steering front           where the turn ends with the front axle alone
  agvbench plan --workspace rectangle:4x3    what fits on a smaller floor, and where to start
  agvbench plan --repeats 10                 how many hours ten repeats of each take

TRAJECTORY is a name ("5", "slalom") or a .toml file; names are looked for in ./trajectories first, then among those
that ship with agvbench. A trajectory that cannot be driven is shown with the reason, and the exit code is 2. Where none
is named, those that need what the vehicle does not have (a steered rear axle, commands of its unit) are skipped.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from agvbench.errors import FlagError, PlanError
from agvbench.running.configuration.option_types import number, whole_number

if TYPE_CHECKING:
    from agvbench.planning import DryRun
    from agvbench.types import Pose

HELP = "show what trajectories mean for a vehicle, without driving"
_MODES = ("abeam", "front", "rear", "opposite", "crab")
_CONDITIONS = ("uncalibrated", "calibrated", "corrected")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("trajectories", nargs="*", metavar="TRAJECTORY", help="name or .toml file (default: all)")
    add("--vehicle", metavar="FILE", help="vehicle file (default: vehicle.toml here, else the thesis' vehicle)")
    add("--condition", action="append", choices=_CONDITIONS, help="repeatable (default: uncalibrated, calibrated)")
    add(
        "--workspace", default="circle:6.1", metavar="SHAPE", help="circle:D, ellipse:WxH, rectangle:WxH, polygon:X,Y …"
    )
    add("--margin", type=number, metavar="M", help="how far the axles stay inside its edge [m] (default: 0.25)")
    add("--start", metavar="X,Y,DEG", help="start pose on the floor [m, m, °] (default: where there is most room)")
    add("--steering", choices=_MODES, help="steer in this mode instead of the trajectory's")
    add("--directory", type=Path, metavar="DIR", help="where names are looked for")
    add("--repeats", type=whole_number, default=1, metavar="N", help="repeats of each, for the total time (default: 1)")
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--commands", action="store_true", help="print the timed commands as CSV")
    output.add_argument("--json", action="store_true", help="print the table as JSON")


def run(args: argparse.Namespace) -> int:
    """Plan, print, and say what cannot be driven."""
    from agvbench.planning.workspace import DEFAULT_MARGIN_M, Workspace
    from agvbench.running.configuration.vehicles import lab_vehicle
    from agvbench.workflows.plan import plan_trajectories

    if args.repeats < 1:
        raise FlagError("repeats must be positive", where="--repeats", value=args.repeats, limit="at least 1")
    made = plan_trajectories(
        args.trajectories,
        vehicle=lab_vehicle() if args.vehicle is None else args.vehicle,
        conditions=args.condition or ("uncalibrated", "calibrated"),
        workspace=Workspace.parse(args.workspace, DEFAULT_MARGIN_M if args.margin is None else args.margin),
        start=_start(args.start),
        steering=args.steering or "",
        directory=args.directory,
        repeats=args.repeats,
    )
    _print(made, args)
    # Without a selection, trajectories that this kind of vehicle cannot drive anywhere are no failure.
    skipped = [] if args.trajectories or not made.plans else made.unsuited
    failed = [problem for problem in made.problems if problem not in skipped]
    for word, problems in (("skipped: ", skipped), ("", failed)):
        for problem in problems:
            print(f"agvbench plan: {word}{problem}", file=sys.stderr)
    return PlanError.exit_code if failed else 0


def _print(made: DryRun, args: argparse.Namespace) -> None:
    from rich.console import Console

    from agvbench.reporting.console.plan import commands_csv, print_dry_run, to_json

    if args.json:
        print(to_json(made))
    elif args.commands:
        print(commands_csv(made))
    else:
        print_dry_run(made, Console())


def _start(text: str | None) -> Pose | None:
    import math

    from agvbench.types import Pose

    if text is None:
        return None
    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise FlagError("start is not a pose", where="--start", value=repr(text), limit="X,Y,DEG") from None
    start = Pose(x, y, math.radians(heading))
    if not start.is_finite:
        raise FlagError("start is not finite", where="--start", value=repr(text))
    return start
