"""Run one motion capture adapter as its own process on the bus.

examples:
  agvbench mocap sim --connect tcp/127.0.0.1:7447      a simulated camera for the vehicle of 'agvbench agv sim'
  agvbench mocap sim --camera rate_hz=240 --camera lost=0.01
  agvbench mocap --decode stream.pcapng               what a captured NatNet stream says, a JSON line a packet
  agvbench mocap --decode frame.bin --natnet-version 4.1
"""

from __future__ import annotations

import argparse
from pathlib import Path

from agvbench.cli import _adapter_arguments as shared
from agvbench.errors import FlagError

HELP = "run a motion capture adapter as its own process, or decode a captured stream"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("adapter", metavar="ADAPTER", nargs="?", help="SCHEME or SCHEME:ADDRESS, such as sim")
    parser.add_argument(
        "--decode",
        metavar="FILE",
        type=Path,
        help="print the NatNet packets of a pcap, pcapng or single datagram as JSON lines, and run nothing",
    )
    parser.add_argument(
        "--natnet-version",
        metavar="MAJOR.MINOR",
        help="of the captured stream (default: as its handshake says)",
    )
    shared.add_seed_argument(parser)
    shared.add_camera_arguments(parser)
    shared.add_bus_arguments(parser, shared.MOCAP_ENDPOINT)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal ends it, or decode; return the exit code."""
    if (arguments.adapter is None) == (arguments.decode is None):
        raise FlagError("either an adapter runs or a file is decoded", remedy="name one of the two")
    if arguments.decode is not None:
        from agvbench.adapters.natnet.decode_file import print_packets

        print_packets(arguments.decode, arguments.natnet_version)
        return 0
    return shared.run_with(arguments, shared.MOCAP_ENDPOINT, agv=None, mocap=arguments.adapter)
