"""Calibrate, drive the eight test trajectories under each condition, write campaign and report.

Simulated by default: no hardware, no service to start. The vehicle is driven over the bus, every run is recorded
when it is finished, and --resume goes on after any interruption.

examples:
  agvbench bench                                  calibrate and drive 8 trajectories, 10 repeats each
  agvbench bench --dry-run                        what would be driven, for how long, on how much floor
  agvbench bench --repeats 3 --out tonight        fewer repeats, into the directory tonight/
  agvbench bench --resume --out tonight           go on where it stopped
  agvbench bench --place auto                     between runs the vehicle drives itself back to the start
  agvbench bench --plant my_plant.py:make_plant   your own simulated plant
  agvbench bench --trajectories garage,figure_eight   these in place of the eight
  agvbench bench --conditions calibrated          calibrate, then drive under this condition only
  agvbench bench --listen tcp/127.0.0.1:7447      agvbench watch shows it in another terminal
  agvbench bench --live                           a Rerun viewer shows it
  agvbench bench endurance                        another benchmark: bench_endurance.py
  agvbench bench --against A --fail-on 'position_error.p95>+10%' --junitxml bench.xml
                                                  compare with the campaign A at the end, for a nightly job
  agvbench bench --until decided --against A --calibration A/vehicle.toml --repeats 20
                                                  at most 20 repeats, fewer where the comparison is decided before

--until decided compares the runs so far with those of A after every round of repeats, from the third on. It stops when
a regression is shown, or when each comparison is decided: better, or the same within its margin. The chance of any
false regression is at most 1 %, that of any false "same" at most 5 %, over all comparisons and analyses together.

exit codes: 0 every run is valid; 1 a run failed, or the comparison with --against shows a regression, or a rule failed;
2 bad input or set-up; 3 A is not comparable, or the comparison is not decided.
"""

from __future__ import annotations

import argparse

HELP = "calibrate, drive the eight trajectories, write campaign and report"
PACKAGES = ("numba", "zenoh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from agvbench.running.configuration.session_options import add_options

    parser.add_argument(
        "benchmarks",
        nargs="*",
        metavar="BENCHMARK",
        help="files bench_NAME.py, or NAME for one beside you or shipped (default: calibration trajectories; with "
        "--calibration trajectories)",
    )
    parser.add_argument("-k", dest="only", metavar="EXPRESSION", help="only benchmarks whose names match, as in pytest")
    add_options(parser.add_argument)
    parser.add_argument(
        "--junitxml",
        metavar="FILE",
        help="write a test case for each run as JUnit XML, with its errors as properties, for CI servers",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the benchmarks; return the exit code."""
    from agvbench.cli._option_values import check_values

    check_values(vars(arguments))
    from agvbench.workflows.bench import run_benchmarks

    return run_benchmarks(arguments.benchmarks, vars(arguments), only=arguments.only, junit=arguments.junitxml)
