"""Compare two campaigns (firmware, nights, vehicles), or two conditions of one.

Says per trajectory and condition whether end position error, heading error and |Δs| are better, the same within a
margin, worse, or whether the repeats cannot say. End position error and heading error decide what a regression is;
|Δs|, as the thesis defines it, is a note unless --with-delta-s. Shows by how much the mean end position moved. Two
campaigns that do not differ report a regression with a chance of at most 1 %. What is missing from a campaign, and
differences between vehicles, cameras, trajectories and calibrations, are listed first.

examples:
  agvbench compare campaigns/last-night campaigns/tonight
  agvbench compare A B --margin-mm 5 --margin-deg 0.5 --json comparison.json
  agvbench compare A --conditions uncalibrated calibrated
  agvbench compare A B --conditions calibrated corrected     calibrated of A, corrected of B

exit codes: 0 no regression; 1 regression (with --fail-on any: any difference); 2 could not compare;
3 inconclusive: a campaign is incomplete, or the vehicles take commands in different units.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from agvbench.running.configuration.session_options import number

HELP = "compare two campaigns, or two conditions: better, same, worse, or cannot say"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench compare``."""
    parser.add_argument("a", metavar="A", type=Path, help="campaign directory to compare with")
    parser.add_argument("b", metavar="B", type=Path, nargs="?", help="campaign directory that is judged")
    parser.add_argument(
        "--conditions", metavar=("OF_A", "OF_B"), nargs=2, help="compare this condition of A with that of B (or of A)"
    )
    parser.add_argument(
        "--fail-on", choices=("regression", "any", "never"), default="regression", help="when to exit with 1"
    )
    parser.add_argument(
        "--with-delta-s", action="store_true", help="|Δs| worse alone is a regression, too, instead of a note"
    )
    parser.add_argument(
        "--margin-mm", metavar="MM", type=number, help="noise band of end position error and |Δs| (default: 5)"
    )
    parser.add_argument("--margin-deg", metavar="DEG", type=number, help="noise band of the heading error (default: 1)")
    parser.add_argument(
        "--across-vehicles", action="store_true", help="compare vehicles that take commands in different units"
    )
    parser.add_argument("--json", metavar="F", type=Path, help="write the comparison as JSON, too")


def run(arguments: argparse.Namespace) -> int:
    """Compare, print the comparison, and return its exit code."""
    from agvbench.campaign import Campaign
    from agvbench.reporting.console.tables import print_comparison, print_warnings, wide_console
    from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
    from agvbench.statistics.quantities import END_POSE, QUANTITIES
    from agvbench.workflows.comparability import comparability
    from agvbench.workflows.compare import compare, exit_code, write_json

    console = wide_console()
    a = Campaign.open(arguments.a)
    b = None if arguments.b is None else Campaign.open(arguments.b)
    known = comparability(a, b, across_vehicles=arguments.across_vehicles)
    print_warnings(console, known.sentences)
    comparison = compare(
        a,
        b,
        conditions=tuple(arguments.conditions) if arguments.conditions else None,
        margin_mm=MARGIN_MM if arguments.margin_mm is None else arguments.margin_mm,
        margin_deg=MARGIN_DEG if arguments.margin_deg is None else arguments.margin_deg,
        deciding=QUANTITIES if arguments.with_delta_s else END_POSE,
        across_vehicles=arguments.across_vehicles,
    )
    if arguments.json:
        write_json(comparison, arguments.json, known)
    print_comparison(console, comparison)
    return exit_code(comparison, arguments.fail_on, known)
