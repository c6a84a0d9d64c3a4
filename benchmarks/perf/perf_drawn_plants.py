"""What calibration buys on vehicles drawn at random: a sweep of bench sessions on ``random_plant``, one a seed.

For each trajectory with both conditions: is the calibrated median of end position error, heading error and |Δs| smaller
than the uncalibrated one?
Prints the share over all plants and trajectories, and every exception. ``--plants 20 --repeats 10`` by default, on two
processes; ``--cluster tcp://…`` drives them on the workers of a Dask cluster, which share this folder.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import pandas as pd
from scipy.stats import binomtest

import agvbench

FIRST_SEED = 1000
COLUMNS = ["position_error_mm", "heading_error_deg", "delta_s_mm"]
GRID = """
[fixed]
plant = "agvbench.simulator:random_plant"
repeats = {repeats}

[grid]
seed = "{first}..{last}"
"""


def _driven(plants: int, repeats: int, jobs: int, cluster: str) -> pd.DataFrame:
    """Return the medians of every plant: a row for each trajectory and condition."""
    with tempfile.TemporaryDirectory() as folder:
        grid = Path(folder) / "grid.toml"
        grid.write_text(GRID.format(repeats=repeats, first=FIRST_SEED, last=FIRST_SEED + plants - 1))
        found = agvbench.sweep(grid, Path(folder) / "sweep", jobs=jobs, cluster=cluster)
    if failed := found.attrs["failed"]:
        raise SystemExit("\n".join(f"seed {FIRST_SEED + cell}: {cause}" for cell, cause in failed.items()))
    return found[found["trajectory"].isin([str(n) for n in range(1, 9)])].rename(columns={"seed": "plant"})


def _medians(found: pd.DataFrame) -> pd.DataFrame:
    table = found.pivot(index=["plant", "trajectory"], columns="condition", values=COLUMNS)
    long = table.stack(level=0, future_stack=True).rename_axis(["plant", "trajectory", "quantity"])
    return long.dropna(subset=["uncalibrated", "calibrated"])


def main() -> None:
    """Drive, and print the shares and the exceptions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cluster", metavar="ADDRESS", default="")
    arguments = parser.parse_args()
    medians = _medians(_driven(arguments.plants, arguments.repeats, arguments.jobs, arguments.cluster))
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
