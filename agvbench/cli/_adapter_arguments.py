"""What the commands that run adapters have in common."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from agvbench.errors import FlagError
from agvbench.running.configuration.option_types import number, whole_number

if TYPE_CHECKING:
    from agvbench.adapters.contract import AdapterOptions
    from agvbench.adapters.contract_checks import CheckResult
    from agvbench.vehicle.channels import Channels

AGV_ENDPOINT = "tcp/127.0.0.1:7447"
MOCAP_ENDPOINT = "tcp/127.0.0.1:7448"


def add_bus_arguments(parser: argparse.ArgumentParser, default_listen: str) -> None:
    """Declare where on the bus the adapters are."""
    group = parser.add_argument_group("bus")
    group.add_argument(
        "--listen",
        action="append",
        metavar="ENDPOINT",
        help=f"wait for others here (default: {default_listen} unless --connect is given); "
        "tcp/0.0.0.0:PORT lets other machines in without any authentication; tls/0.0.0.0:PORT with "
        "--bus-config requires certificates",
    )
    group.add_argument("--connect", action="append", metavar="ENDPOINT", help="connect to a process that listens there")
    group.add_argument(
        "--bus-config",
        metavar="FILE",
        help="certificates and rules of a secured bus, as Zenoh writes them (docs/how-to/secure-the-bus.md)",
    )
    group.add_argument("--lab", default="lab", help="name of the lab on the bus (default: %(default)s)")
    group.add_argument(
        "--vehicle-name", default="agv1", metavar="NAME", help="name of the vehicle on the bus (default: %(default)s)"
    )


def add_vehicle_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what a simulated vehicle needs."""
    group = parser.add_argument_group("vehicle")
    group.add_argument(
        "--plant",
        default="agvbench.simulator:make_plant",
        metavar="MODULE_OR_FILE:FACTORY",
        help="what drives in the simulation (default: %(default)s)",
    )
    group.add_argument(
        "--plant-option",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="set a parameter of the plant, such as understeer_s2_per_m2=0.05; several with commas, or again",
    )
    group.add_argument("--command-unit", choices=("us", "normalised"), help="what it understands (default: us)")
    group.add_argument("--neutral", type=number, metavar="COMMAND", help="where it stands still (default: 1500 or 0)")
    group.add_argument(
        "--vehicle", metavar="FILE", help="vehicle.toml whose command channels it has, in place of unit and neutral"
    )


def add_camera_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the camera itself."""
    parser.add_argument(
        "--camera",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="set an option of the camera, such as rate_hz=240 of a simulated one; several with commas, or again",
    )


def add_seed_argument(parser: argparse.ArgumentParser) -> None:
    """Declare the seed."""
    parser.add_argument(
        "--seed", type=whole_number, default=0, help="of the simulation; the same as the bench's (default: 0)"
    )


def add_check_argument(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare the option that checks an adapter."""
    parser.add_argument(
        "--check", action="store_true", help=f"open the adapter and check it against the contract, {what}; run nothing"
    )


def print_checks(results: Iterator[CheckResult]) -> int:
    """Print the results of contract checks; return the exit code, 1 if one failed."""
    from agvbench.reporting.console.contract_checks import print_check

    failed = [result for result in results if not print_check(result)]
    return 1 if failed else 0


def adapter_options(arguments: argparse.Namespace, options: dict[str, Any]) -> AdapterOptions:
    """Return the options of adapters, as the arguments and `options` say."""
    from agvbench.adapters.contract import AdapterOptions

    return AdapterOptions(vehicle=arguments.vehicle_name, seed=arguments.seed, **options)


def endpoints(arguments: argparse.Namespace, default_listen: str) -> dict[str, list[str]]:
    """Return where to listen and connect."""
    connect = arguments.connect or []
    listen = arguments.listen or ([] if connect else [default_listen])
    return {"listen": listen, "connect": connect}


def vehicle_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_vehicle_arguments` declares."""
    from agvbench.adapters.contract import named_values

    plant_options = named_values(arguments.plant_option, "--plant-option")
    return {"plant": arguments.plant, "plant_options": plant_options, "channels": _channels(arguments)}


def _channels(arguments: argparse.Namespace) -> Channels:
    from agvbench.model import VehicleModel
    from agvbench.vehicle.channels import Channels

    if not arguments.vehicle:
        return Channels.alike(arguments.command_unit or "us", arguments.neutral)
    for option, value in {"--command-unit": arguments.command_unit, "--neutral": arguments.neutral}.items():
        if value is not None:
            raise FlagError("the vehicle file says this", where=option, value=value, remedy=f"leave out {option}")
    return VehicleModel.load(arguments.vehicle).channels


def camera_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_camera_arguments` declares."""
    from agvbench.adapters.contract import camera_options

    return {"camera": camera_options(arguments.camera)}


def run_with(
    arguments: argparse.Namespace,
    default_listen: str,
    options: dict[str, Any],
    *,
    agv: str | None,
    mocap: str | None,
    status_s: float | None = None,
) -> int:
    """Run adapters as the arguments and the adapters' `options` say; `status_s` is that of `run_adapters`."""
    from agvbench.workflows.adapter_process import run_adapters

    return run_adapters(
        adapter_options(arguments, options),
        agv=agv, mocap=mocap, lab=arguments.lab, bus_config=arguments.bus_config, status_s=status_s,
        **endpoints(arguments, default_listen),
    )  # fmt: skip
