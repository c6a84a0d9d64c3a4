"""What calibration buys on vehicles drawn at random: whole bench sessions on ``random_plant``, one a seed.

For each trajectory with both conditions: is the calibrated median of end position error, heading error and |Δs| smaller
than the uncalibrated one?
Prints the share over all plants and trajectories, and every exception. ``--plants 20 --repeats 10`` by default.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
from scipy.stats import binomtest

from agvbench.campaign import Campaign
from agvbench.statistics import pose_errors
from agvbench.statistics.quantities import QUANTITIES

FIRST_SEED = 1000
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
COLUMNS = [quantity.column for quantity in QUANTITIES]


def _drive(seed: int, repeats: int, folder: Path) -> pd.DataFrame:
    out = folder / f"plant{seed}"
    options = ["--plant=agvbench.simulator:random_plant", f"--seed={seed}", f"--repeats={repeats}", "--no-report"]
    command = [sys.executable, "-c", PROGRAM, "bench", *options, f"--out={out}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode not in {0, 1}:
        raise SystemExit(f"seed {seed}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    errors = pose_errors(Campaign.open(out))
    errors = errors[(errors["status"] == "ok") & errors["trajectory"].isin([str(n) for n in range(1, 9)])]
    return errors.assign(plant=seed)


def _medians(errors: pd.DataFrame) -> pd.DataFrame:
    absolute = errors.assign(**{name: errors[name].abs() for name in COLUMNS})
    table = absolute.pivot_table(index=["plant", "trajectory"], columns="condition", values=COLUMNS, aggfunc="median")
    long = table.stack(level=0, future_stack=True).rename_axis(["plant", "trajectory", "quantity"])
    return long.dropna(subset=["uncalibrated", "calibrated"])


def main() -> None:
    """Drive, and print the shares and the exceptions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=10)
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.plants)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        drives = list(pool.map(lambda seed: _drive(seed, arguments.repeats, Path(folder)), seeds))
    medians = _medians(pd.concat(drives))
    better = medians["calibrated"] < medians["uncalibrated"]
    for name, cells in [("all", better), *((q, better.xs(q, level="quantity")) for q in COLUMNS)]:
        interval = binomtest(int(cells.sum()), len(cells)).proportion_ci(method="exact")
        print(
            f"{name:20s} calibrated better in {cells.sum():4d} of {len(cells):4d} medians: {cells.mean():6.1%}"
            f" (95 % interval {interval.low:.1%} to {interval.high:.1%})"
        )
    print("\nmedian over plants:")
    print(medians.groupby(["quantity", "trajectory"]).median().round(2).to_string())
    print("\nexceptions:")
    print(medians[~better].round(2).to_string() if (~better).any() else "none")


if __name__ == "__main__":
    main()
