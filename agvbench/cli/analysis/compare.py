"""Compare two campaigns (firmware, nights, vehicles), or two conditions of one.

Says per trajectory and condition whether end position error, heading error and |Δs| are better, the same within a
margin, worse, or whether the repeats cannot say. End position error and heading error decide what a regression is;
|Δs|, as the thesis defines it, is a note unless --with-delta-s; --metrics adds errors along the path, time, or a lab's
own metrics. Shows by how much the mean end position moved. Two campaigns that do not differ report a regression with a
chance of at most 1 %. What is missing from a campaign, and differences between vehicles, cameras, trajectories and
calibrations, are listed first.

A gate limits a statistic (median, mean, p95, max, bias, sd) of a metric over the repeats of each trajectory: --fail-on
METRIC.STATISTIC>LIMIT, or a TOML file of rules. A limit with a plus sign is a growth since A, which must be shown by a
test (a chance of at most 1 % over all rules where nothing has grown); one without is a limit on B. The unit is that of
the metric, %, or sd: standard deviations of the repeats of A. A growth must be shown to be beyond its limit: to find a
drift to either side of 2 sd, write a lower one, such as across_error.bias>+0.5sd.

examples:
  agvbench compare campaigns/last-night campaigns/tonight
  agvbench compare A B --margin-mm 5 --margin-deg 0.5 --json comparison.json
  agvbench compare A --conditions uncalibrated calibrated
  agvbench compare A B --conditions calibrated corrected     calibrated of A, corrected of B
  agvbench compare A B --metrics cross_track_rms,driving_time
  agvbench compare A B --fail-on 'position_error.p95>+10%' --fail-on 'cross_track_rms.median>12mm'
  agvbench compare A B --fail-on 'across_error.bias>+0.5sd'  fail where it drifts to either side
  agvbench compare A B --gate gate.toml --junit compare.xml --markdown summary.md
  agvbench compare A --plan --margin-mm 5      how many repeats will decide, before B is driven

exit codes: 0 nothing failed; 1 a regression (with --fail-on any: any difference), or a rule failed; 2 could not
compare; 3 inconclusive: a campaign is incomplete, the vehicles take commands in different units, or there are too few
repeats for a rule.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from agvbench.cli._margins import add_margin_arguments, margins
from agvbench.running.configuration.option_types import number

if TYPE_CHECKING:
    from rich.console import Console

    from agvbench.campaign import Campaign
    from agvbench.metrics.gate import GateCheck
    from agvbench.statistics import Comparison
    from agvbench.workflows.comparison.comparability import Comparability

HELP = "compare two campaigns, or two conditions: better, same, worse, or cannot say"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench compare``."""
    parser.add_argument("a", metavar="A", type=Path, help="campaign directory to compare with")
    parser.add_argument("b", metavar="B", type=Path, nargs="?", help="campaign directory that is judged")
    parser.add_argument(
        "--conditions", metavar=("OF_A", "OF_B"), nargs=2, help="compare this condition of A with that of B (or of A)"
    )
    parser.add_argument(
        "--fail-on", metavar="RULE", action="append", default=[],
        help="when to exit with 1: regression (the default without rules), any, never, or METRIC.STATISTIC>LIMIT; "
        "may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--gate", metavar="F", type=Path, help="TOML file with rules: docs/reference/statistics.md#gates"
    )
    parser.add_argument("--metrics", metavar="NAMES", default="", help="metrics that decide, too, commas between")
    parser.add_argument(
        "--with-delta-s", action="store_true", help="|Δs| worse alone is a regression, too, instead of a note"
    )
    add_margin_arguments(parser, "end position error and |Δs|", "the heading error")
    parser.add_argument(
        "--across-vehicles", action="store_true", help="compare vehicles that take commands in different units"
    )
    parser.add_argument("--plan", action="store_true", help="say how many repeats decide a comparison with A")
    parser.add_argument(
        "--power", metavar="P", type=number, default=0.9, help="of --plan: the chance of a verdict (0.9)"
    )
    parser.add_argument("--json", metavar="F", type=Path, help="write the comparison as JSON, too")
    parser.add_argument("--junit", metavar="F", type=Path, help="write it as JUnit XML, too, for CI servers")
    parser.add_argument("--markdown", metavar="F", type=Path, help="write it as Markdown, too, for a pull request")


def run(arguments: argparse.Namespace) -> int:
    """Compare, print the comparison, and return its exit code."""
    from agvbench.campaign import Campaign
    from agvbench.reporting.console.tables import print_comparison, print_gate, print_warnings, wide_console
    from agvbench.workflows.comparison.comparability import comparability
    from agvbench.workflows.comparison.decision import FailurePolicy, exit_code

    console = wide_console()
    if arguments.plan:
        return _plan(arguments, console)
    policy = FailurePolicy.parse(arguments.fail_on, arguments.gate)
    a = Campaign.open(arguments.a)
    b = None if arguments.b is None else Campaign.open(arguments.b)
    known = comparability(a, b, across_vehicles=arguments.across_vehicles)
    print_warnings(console, known.sentences)
    comparison = _compared(arguments, a, b)
    checks = policy.checks(a, b, _pair(arguments))
    _write(arguments, comparison, checks, known, failing=policy.verdicts != "never")
    print_comparison(console, comparison)
    print_gate(console, checks)
    return exit_code(comparison, policy, checks, known)


def _plan(arguments: argparse.Namespace, console: Console) -> int:
    """Print how many repeats decide; return 0."""
    from agvbench.errors import FlagError
    from agvbench.reporting.console.tables import print_planned_repeats
    from agvbench.statistics import pose_errors
    from agvbench.statistics.repeats.sample_size import plan_repeats

    if arguments.b is not None:
        raise FlagError(
            "plans a comparison with one campaign", where="--plan", value=arguments.b, remedy="leave it out"
        )
    for name in ("conditions", "metrics", "gate", "json", "junit", "markdown"):
        if getattr(arguments, name):
            raise FlagError(
                "says nothing with --plan, which compares nothing", where=f"--{name}", remedy="leave it out"
            )
    in_mm, in_deg = margins(arguments)
    planned = plan_repeats(pose_errors(arguments.a), margin_mm=in_mm, margin_deg=in_deg, power=arguments.power)
    print_planned_repeats(console, planned, arguments.power)
    return 0


def _pair(arguments: argparse.Namespace) -> tuple[str, str] | None:
    return tuple(arguments.conditions) if arguments.conditions else None


def _compared(arguments: argparse.Namespace, a: Campaign, b: Campaign | None) -> Comparison:
    from agvbench.statistics.quantities import END_POSE, QUANTITIES
    from agvbench.workflows.comparison.compare import compare

    in_mm, in_deg = margins(arguments)
    return compare(
        a,
        b,
        conditions=_pair(arguments),
        margin_mm=in_mm,
        margin_deg=in_deg,
        deciding=QUANTITIES if arguments.with_delta_s else END_POSE,
        metrics=[name.strip() for name in arguments.metrics.split(",") if name.strip()],
        across_vehicles=arguments.across_vehicles,
    )


def _write(
    arguments: argparse.Namespace,
    comparison: Comparison,
    checks: Sequence[GateCheck],
    known: Comparability,
    *,
    failing: bool,
) -> None:
    """Write the files that were asked for."""
    from agvbench.reporting.gate_files import write_junit, write_markdown
    from agvbench.workflows.comparison.decision import write_json

    if arguments.json:
        write_json(comparison, arguments.json, known, checks)
    if arguments.junit:
        write_junit(arguments.junit, comparison, checks, failing=failing)
    if arguments.markdown:
        write_markdown(arguments.markdown, comparison, checks, known, failing=failing)
