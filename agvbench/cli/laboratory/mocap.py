"""Run one motion capture adapter as its own process on the bus.

examples:
  agvbench mocap sim --connect tcp/127.0.0.1:7447      a simulated camera for the vehicle of 'agvbench agv sim'
  agvbench mocap sim --camera rate_hz=240 --camera lost=0.01
  agvbench mocap my_lab.py:5006 --check               whether an adapter of your own keeps the contract, a line a check
  agvbench mocap my_lab.py:5006                       frames per second, tracked share and last pose, every second
  agvbench mocap --decode stream.pcapng               what a captured NatNet stream says, a JSON line a packet
  agvbench mocap --decode frame.bin --natnet-version 4.1
  agvbench mocap --emulate                            a NatNet server on loopback, with a simulated vehicle in view
  agvbench mocap --emulate --natnet-version 3.1 --multicast 239.255.42.99
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from agvbench.cli import _adapter_arguments as shared
from agvbench.errors import FlagError
from agvbench.running.configuration.option_types import whole_number

HELP = "run a motion capture adapter as its own process, or check it; decode or emulate a NatNet stream"
PACKAGES = ("zenoh",)
_TERMINAL_S, _VERBOSE_S = 1.0, 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "adapter", metavar="ADAPTER", nargs="?", help="SCHEME[:ADDRESS], such as sim, or FILE.py[:ADDRESS]"
    )
    shared.add_check_argument(parser, "watching its frames for a second")
    parser.add_argument(
        "--verbose", action="store_true", help="print the status of the stream every 10 s also where no terminal is"
    )
    parser.add_argument(
        "--decode",
        metavar="FILE",
        type=Path,
        help="print the NatNet packets of a pcap, pcapng or single datagram as JSON lines, and run nothing",
    )
    parser.add_argument(
        "--natnet-version",
        metavar="MAJOR.MINOR",
        help="of the captured stream (default: as its handshake says), or of the emulated one (default: 4.1)",
    )
    emulated = parser.add_argument_group("emulation")
    emulated.add_argument(
        "--emulate", action="store_true", help="be a NatNet server that sees a plant drive in circles"
    )
    emulated.add_argument("--multicast", metavar="GROUP", help="stream to this group (default: unicast)")
    emulated.add_argument(
        "--port", type=whole_number, default=1510, help="command port, 0 for any (default: %(default)s)"
    )
    emulated.add_argument(
        "--plant", default="agvbench.simulator:make_plant", metavar="MODULE_OR_FILE:FACTORY", help="what drives"
    )
    shared.add_seed_argument(parser)
    shared.add_camera_arguments(parser)
    shared.add_bus_arguments(parser, shared.MOCAP_ENDPOINT)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal ends it, check the adapter, or decode; return the exit code."""
    if (arguments.adapter is not None) + (arguments.decode is not None) + arguments.emulate != 1:
        raise FlagError(
            "either an adapter runs, a file is decoded or a stream emulated", remedy="name one of the three"
        )
    if arguments.check and arguments.adapter is None:
        raise FlagError("only an adapter can be checked", where="--check", remedy="write mocap ADAPTER --check")
    if arguments.emulate:
        from agvbench.adapters.contract import AdapterOptions, camera_options
        from agvbench.workflows.adapter_process import emulate

        camera = camera_options(arguments.camera)
        options = AdapterOptions(
            vehicle=arguments.vehicle_name, seed=arguments.seed, plant=arguments.plant, camera=camera
        )
        return emulate(options, arguments.natnet_version or "4.1", arguments.multicast, arguments.port)
    if arguments.decode is not None:
        from agvbench.adapters.natnet.transcript import print_packets

        print_packets(arguments.decode, arguments.natnet_version)
        return 0
    given = {"plant": arguments.plant} | shared.camera_options(arguments)
    if arguments.check:
        from agvbench.adapters.contract_checks import check_camera

        return shared.print_checks(check_camera(arguments.adapter, shared.adapter_options(arguments, given)))
    status_s = _TERMINAL_S if sys.stdout.isatty() else _VERBOSE_S if arguments.verbose else None
    return shared.run_with(
        arguments, shared.MOCAP_ENDPOINT, given, agv=None, mocap=arguments.adapter, status_s=status_s
    )
