"""Turn recordings of any lab into a campaign: CSV, bags of ROS 1 and ROS 2, TUM files.

A mapping in TOML says which column or topic is what, in which unit and axis, which rows were driven, what jumps are
impossible, and where a recording is cut into runs. --guess writes one from a recording: columns by their names, topics
by their types, units by what vehicles do, and the questions that only you can answer. "dart" ships with agvbench;
docs/how-to/import-your-csv.md and docs/how-to/exchange-with-ros.md show how to write one. Bags need the extra ros:
pip install 'agvbench[ros]'. Every row that is left out is counted, on the console and in the campaign's import.parquet.

examples:
  agvbench import --guess monday.csv --out mapping.toml
  agvbench import --mapping dart.toml recordings/*.csv --out campaigns/dart
  agvbench import --mapping mapping.toml monday.csv tuesday.csv --out campaigns/lab
  agvbench import --guess rosbag2_2026_11_25/ --out bag.toml
  agvbench import --mapping bag.toml rosbag2_2026_11_25/ old.bag --out campaigns/ros
"""

from __future__ import annotations

import argparse

HELP = "turn recordings (CSV, ROS bags, TUM) into a campaign"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="CSV files, bags or TUM files; their names become the runs' ids"
    )
    how = parser.add_mutually_exclusive_group(required=True)
    how.add_argument("--mapping", metavar="M.toml", help="a mapping file, or the name of a shipped one")
    how.add_argument("--guess", action="store_true", help="guess the mapping of FILE, and write it to --out")
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="the campaign directory to make (empty or new); or the mapping file"
    )


def run(arguments: argparse.Namespace) -> int:
    """Import; return the exit code."""
    from rich.console import Console

    from agvbench.reporting.console.recordings import print_guess, print_import
    from agvbench.workflows.exchange.import_recordings import run_guess, run_import

    if arguments.guess:
        print_guess(arguments.out, *run_guess(arguments.files, arguments.out), Console())
        return 0
    print_import(run_import(arguments.mapping, arguments.files, arguments.out), Console())
    return 0
