"""Report on a campaign: what calibration bought, and how sure that is.

Writes report.html (one file, works offline, prints), report.md, tables/*.csv and *.tex, and campaign.rrd for
the Rerun viewer, and prints a summary.

examples:
  agvbench report campaigns/tonight
  agvbench report campaigns/tonight --out /tmp/report
  agvbench report campaigns/tonight --against campaigns/monday
  rerun campaigns/tonight/report/campaign.rrd
"""

from __future__ import annotations

import argparse
from pathlib import Path

from agvbench.cli._margins import add_margin_arguments, margins

HELP = "write the report of a campaign: HTML, tables, figures, Rerun recording"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench report``."""
    parser.add_argument("campaign", metavar="DIR", type=Path, help="campaign directory")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to write (default: report/ in the campaign)")
    add_margin_arguments(parser, "distances", "headings")
    parser.add_argument(
        "--against", metavar="DIR", type=Path, help="campaign to list what changed from (default: the one before)"
    )
    parser.add_argument(
        "--uncertainty", metavar="FILE", type=Path, help="TOML file with [uncertainty] (default: that of the campaign)"
    )
    parser.add_argument("--no-recording", action="store_true", help="leave out campaign.rrd")


def run(arguments: argparse.Namespace) -> int:
    """Write the report and print its summary."""
    from importlib.util import find_spec

    from agvbench.reporting.console.tables import print_report, wide_console
    from agvbench.reporting.write import write_report

    in_mm, in_deg = margins(arguments)
    has_rerun = find_spec("rerun") is not None  # the light installation has not
    report = write_report(
        arguments.campaign,
        arguments.out,
        margin_mm=in_mm,
        margin_deg=in_deg,
        recording=has_rerun and not arguments.no_recording,
        against=arguments.against,
        uncertainty=arguments.uncertainty,
    )
    print_report(wide_console(), report)
    if not has_rerun and not arguments.no_recording:
        print("campaign.rrd is left out: rerun-sdk is not installed")
    if failures := report.data.failures:
        raise next(iter(failures.values()))
    return 0
