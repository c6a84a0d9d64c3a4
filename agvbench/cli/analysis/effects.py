"""List the physical effects that a vehicle model may have, or begin a new one.

An effect is one file, in a folder of agvbench/effects/ or in the folder effects/ of a lab: parameters with their
bounds, and hooks that say what it does. A new file is simulated, tested, listed and fitted without another line
elsewhere. A hook that cannot be compiled is reported with its line.

examples:
  agvbench effects                         name, stage, parameters, and the assumption that each relaxes
  agvbench effects --markdown              the same at length, as in the documentation
  agvbench effects new servo_warm_up       write agvbench/effects/servo_warm_up.py, to be edited
  agvbench effects new scrub --hook move   with the stage, imports and arguments of the hook move (default: drive)
  agvbench effects new seam --dir effects  write it into the folder effects/ of your lab

The how-to docs/how-to/write-an-effect.md takes an effect from the file to the diagnosis that names it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "list the physical effects that a model may have; write the file of a new one"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench effects``."""
    parser.add_argument("--markdown", action="store_true", help="print the page of the reference")
    actions = parser.add_subparsers(dest="action", metavar="ACTION")
    new = actions.add_parser(
        "new", help="write the file of a new effect", description="Write the file of a new effect."
    )
    new.add_argument("name", metavar="NAME", help="its name: lower case, with underscores")
    new.add_argument(
        "--hook",
        metavar="HOOK",
        default="drive",
        help="arrive, aim, adopt, steer, drive, move, drift, capture or see (default: drive)",
    )
    new.add_argument("--dir", metavar="DIR", type=Path, help="folder to write into (default: agvbench/effects)")


def run(arguments: argparse.Namespace) -> int:
    """List effects and check their hooks, or write a template; return the exit code."""
    import sys

    from agvbench.reporting.console.effects import effects_table, reference_page
    from agvbench.reporting.console.tables import wide_console
    from agvbench.workflows.effects import check_effects, write_template

    if arguments.action == "new":
        print(f"wrote {write_template(arguments.name, arguments.dir, hook=arguments.hook)}")
        print("next: write its equation and parameters; docs/how-to/write-an-effect.md lists the hooks and their state")
        return 0
    if arguments.markdown:
        print(reference_page(), end="")
        return 0
    wide_console().print(effects_table())
    check_effects(lambda text: print(text, file=sys.stderr))
    return 0
