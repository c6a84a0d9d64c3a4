"""Drive a bench session for every combination of options in a grid, and write one table of their results.

GRID.toml names benchmarks, options of agvbench bench that all cells share, and lists of those that vary:

  benchmarks = ["calibration", "trajectories"]   # the usual ones where left out

  [fixed]
  repeats = 3
  plant = "agvbench.simulator:random_plant"

  [grid]                                         # 20 seeds x 2 maps x 3 values of a parameter: 120 cells
  seed = "1..20"
  maps = ["default", "thesis"]

  [grid.plant_option]                            # parameters of the plant; [grid.camera] those of the camera
  understeer_s2_per_m2 = [0.0, 0.05, 0.1]

Every cell is a simulated session in a process of its own. DIR gets results.parquet and results.csv: a row for each
cell, trajectory and condition, with the median magnitude of each metric. Their bytes do not depend on where cells were
driven. cells.jsonl has a line for each cell that has ended, with its cost; --resume drives those that it lacks.

examples:
  agvbench sweep grid.toml --out sweeps/understeer --dry-run        which cells there are
  agvbench sweep grid.toml --out sweeps/understeer --jobs 2         two at a time
  agvbench sweep grid.toml --out sweeps/understeer --resume         go on where it stopped; failures are driven again
  agvbench sweep grid.toml --out sweeps/understeer --diagnose       which effect each cell's model lacks, too
  agvbench sweep grid.toml --out sweeps/understeer --cluster tcp://127.0.0.1:8786
                                                                    on the workers of a Dask cluster
  agvbench sweep grid.toml --out s --cluster tls://10.0.0.5:8786 --tls-ca-file ca.pem --tls-cert pc.pem --tls-key pc.key

exit codes: 0 every cell has a result; 1 a cell failed, and the others have theirs; 2 bad input or set-up.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from agvbench.cli._cluster_arguments import add_cluster_arguments, executor_options
from agvbench.running.configuration.option_types import whole_number

HELP = "bench sessions over a grid of options, on this machine or a cluster"
PACKAGES = ("numba", "zenoh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("grid", metavar="GRID.toml", type=Path, help="what varies, and what does not")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="directory of the sweep")
    parser.add_argument("--jobs", type=whole_number, metavar="N", help="cells at a time (default: one per processor)")
    parser.add_argument("--resume", action="store_true", help="drive the cells that DIR lacks, and those that failed")
    parser.add_argument("--keep", action="store_true", help="keep the campaign of each cell in DIR/campaigns")
    parser.add_argument("--diagnose", action="store_true", help="diagnose each campaign: columns verdict and named")
    parser.add_argument("--dry-run", action="store_true", help="check the grid and print which cells there are")
    add_cluster_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Drive the cells; return the exit code."""
    from dataclasses import replace

    from agvbench.executors import check_address
    from agvbench.reporting.console.sweep import print_plan, print_sweep
    from agvbench.reporting.console.tables import wide_console
    from agvbench.reporting.progress import track
    from agvbench.workflows.sweep import run_sweep
    from agvbench.workflows.sweep.grid import read_grid

    options = replace(executor_options(arguments), jobs=arguments.jobs)
    if arguments.dry_run:
        check_address(options)
        print_plan(wide_console(), read_grid(arguments.grid))
        return 0
    result = run_sweep(
        arguments.grid,
        arguments.out,
        options,
        resume=arguments.resume,
        keep=arguments.keep,
        diagnose=arguments.diagnose,
        track=lambda items, total: track(items, total, what="driving cells"),
    )
    print_sweep(wide_console(), result)
    return 1 if result.failed else 0
