"""Watch a bench while it drives: from another terminal, or from another machine. Nothing can be changed from here.

At a terminal the view is updated in place; elsewhere a line says what has changed. The command ends with the bench.
Ctrl-C ends the view and leaves the bench alone.

examples:
  agvbench bench --listen tcp/127.0.0.1:7447      a bench that can be watched
  agvbench watch                                  watch it, in another terminal
  agvbench watch --once                           print what it does now, and end
  agvbench watch --json                           a JSON line a state, for other programs
  agvbench watch --connect tcp/vehicle-pc:7447 --vehicle-name red     from another machine, one of several vehicles
"""

from __future__ import annotations

import argparse

from agvbench.running.configuration.option_types import number

HELP = "show what a running bench does, here or on another machine"
PACKAGES = ("zenoh",)
_ENDPOINT = "tcp/127.0.0.1:7447"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--once", action="store_true", help="print the state as it is now, and end")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line, for each state that arrives")
    parser.add_argument(
        "--wait", type=number, default=5.0, metavar="S", help="how long to wait for a bench (default: %(default)g s)"
    )
    group = parser.add_argument_group("bus")
    group.add_argument(
        "--connect",
        default=_ENDPOINT,
        metavar="ENDPOINT",
        help="where the bench listens, or the adapters that it is connected to (default: %(default)s)",
    )
    group.add_argument("--bus-config", metavar="FILE", help="certificates of a secured bus, as Zenoh writes them")
    group.add_argument("--lab", metavar="NAME", help="of this lab only (default: any)")
    group.add_argument("--vehicle-name", metavar="NAME", help="of this vehicle only (default: any)")


def run(arguments: argparse.Namespace) -> int:
    """Show states until the bench ends; return the exit code."""
    from agvbench.reporting.console.watch import show_states
    from agvbench.workflows.watch import watched_states

    states = watched_states(
        arguments.connect,
        bus_config=arguments.bus_config,
        lab=arguments.lab,
        vehicle=arguments.vehicle_name,
        wait_s=arguments.wait,
        once=arguments.once,
    )
    with states as watched:
        show_states(watched, as_json=arguments.json, once=arguments.once)
    return 0
