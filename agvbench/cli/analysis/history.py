"""Show the history of every campaign under a folder: trends, and when they stepped.

A night is a campaign. Its value of a metric is the mean over trajectories of the medians of absolute values. A step is
a change of level from one night on, with a 95 % interval of that night and what changed within it: firmware,
calibration, program, vehicle, options or trajectories. Steps are looked for from 10 nights. Without a step in any
metric and condition, one is reported with a chance of about --alpha.

Writes history.html (one file, works offline) and nights.parquet (every nightly value) into --out. A campaign without
errors.parquet is evaluated, and keeps the file. Campaigns that cannot be read are listed.

examples:
  agvbench history nightly
  agvbench history nightly --metric position_error heading_error --condition calibrated
  agvbench history nightly --out /tmp/history --json history.json

exit codes: 0 done, with steps or without; 2 bad input.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from agvbench.running.configuration.option_types import number

HELP = "trends over every campaign under a folder, and the nights on which they stepped"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench history``."""
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder with campaigns, at any depth")
    parser.add_argument("--metric", metavar="NAME", nargs="+", help="only these metrics (default: all)")
    parser.add_argument("--condition", metavar="NAME", nargs="+", help="only these conditions (default: all)")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to write (default: history/ in DIR)")
    parser.add_argument("--json", metavar="F", type=Path, help="write steps, levels and campaigns as JSON, too")
    parser.add_argument(
        "--alpha", metavar="P", type=number, help="chance of any false step over all metrics (default: 0.05)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Read the campaigns, write the page, and print what was found."""
    from agvbench.reporting.console.history import print_history
    from agvbench.reporting.console.tables import wide_console
    from agvbench.reporting.history_report import write_history
    from agvbench.reporting.progress import track
    from agvbench.workflows.history.reading import ALPHA, history
    from agvbench.workflows.history.result import write_json

    found = history(
        arguments.folder,
        metrics=arguments.metric,
        conditions=arguments.condition,
        alpha=ALPHA if arguments.alpha is None else arguments.alpha,
        track=lambda paths, total: track(paths, total, what="reading campaigns"),
    )
    written = write_history(found, arguments.out or arguments.folder / "history")
    if arguments.json:
        write_json(found, arguments.json)
    print_history(wide_console(), found, written)
    return 0
