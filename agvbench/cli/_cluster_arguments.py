"""What the commands that run many simulations have in common: where they run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agvbench.executors import ExecutorOptions


def add_cluster_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the cluster; the names of the certificates are those of ``dask scheduler``."""
    group = parser.add_argument_group("cluster", "workers of a Dask cluster in place of processes of this machine")
    group.add_argument(
        "--cluster",
        metavar="ADDRESS",
        default="",
        help="of the scheduler, such as tcp://127.0.0.1:8786 or tls://10.0.0.5:8786 (needs agvbench[cluster])",
    )
    group.add_argument(
        "--insecure",
        action="store_true",
        help="use tcp:// to another machine: every machine of that network can then run programs here",
    )
    for flag, text in (
        ("--tls-ca-file", "certificate of the authority, for tls://"),
        ("--tls-cert", "certificate of this machine"),
        ("--tls-key", "its private key"),
    ):
        group.add_argument(flag, metavar="FILE", type=Path, help=text)


def executor_options(arguments: argparse.Namespace) -> ExecutorOptions:
    """Return what `add_cluster_arguments` declares."""
    from agvbench.executors import ExecutorOptions

    return ExecutorOptions(
        arguments.cluster,
        insecure=arguments.insecure,
        tls_ca_file=arguments.tls_ca_file,
        tls_cert=arguments.tls_cert,
        tls_key=arguments.tls_key,
    )
