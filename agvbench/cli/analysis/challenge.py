"""Hold blind trials of the diagnosis: plants with a hidden effect, its truth sealed until the answer is given.

For each seed a quiet vehicle is drawn, and driven once for each thing that it may hide: nothing, every effect of the
library, some of them in another order or form, causes outside the library, and pairs. The campaign is diagnosed like
any other; then the truth is unsealed and scored, every share with its exact 95 % bounds.

examples:
  agvbench challenge --seeds 1 --only steering_lag            one trial, in a minute or two
  agvbench challenge --seeds 10 --json challenge.json         everything, ten vehicles: hours
  agvbench challenge --seeds 10 --json challenge.json --resume   go on after an interruption
  agvbench challenge --seeds 300 --only nothing               how often a name is given where nothing is hidden
  agvbench challenge --seeds 10 --json challenge.json --resume --markdown   what a whole file says, as tables
  agvbench challenge --first-seed 5000                        unseen vehicles
  agvbench challenge --campaigns DIR                          keep the campaigns; those that are there are not driven
  agvbench challenge --kinematics differential --only wheel_lag   a vehicle with two driven wheels
  agvbench challenge --seeds 10 --json challenge.json --cluster tcp://127.0.0.1:8786
                                                              on the workers of a Dask cluster
"""

from __future__ import annotations

import argparse

from agvbench.cli._cluster_arguments import add_cluster_arguments, executor_options
from agvbench.running.configuration.option_types import whole_number

HELP = "blind trials of the diagnosis on plants with a hidden effect"
PACKAGES = ("numba", "zenoh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--seeds", type=whole_number, default=1, metavar="N", help="vehicles to draw (default 1)")
    parser.add_argument(
        "--first-seed", type=whole_number, default=0, metavar="N", help="the first vehicle's seed (default 0)"
    )
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="what to hide (default: everything, and some pairs)"
    )
    parser.add_argument(
        "--kinematics",
        choices=("two_axle", "differential"),
        default="two_axle",
        help="kind of vehicle (default two_axle)",
    )
    parser.add_argument("--repeats", type=whole_number, default=5, metavar="N", help="of each trajectory (default 5)")
    parser.add_argument("--jobs", type=whole_number, metavar="N", help="trials at a time (default: one per processor)")
    parser.add_argument("--json", metavar="FILE", dest="json_file", help="write scores and every trial there")
    parser.add_argument("--campaigns", metavar="DIR", help="keep campaigns there; do not drive those that are there")
    parser.add_argument("--markdown", action="store_true", help="print the scores as Markdown")
    parser.add_argument("--resume", action="store_true", help="go on with the trials that the JSON file lacks")
    add_cluster_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Hold the trials; return the exit code: 1 if a trial ended with an error."""
    from rich.console import Console

    from agvbench.challenge.challenge import run_challenge
    from agvbench.reporting.console.challenge import print_scores, scores_markdown

    scores = run_challenge(
        arguments.seeds,
        first_seed=arguments.first_seed,
        specs=arguments.only,
        repeats=arguments.repeats,
        jobs=arguments.jobs,
        json_file=arguments.json_file,
        resume=arguments.resume,
        cluster=executor_options(arguments),
        kinematics=arguments.kinematics,
        campaigns=arguments.campaigns,
    )
    if arguments.markdown:
        print(scores_markdown(scores), end="")
    else:
        print_scores(scores, Console())
    return 1 if scores.errors else 0
