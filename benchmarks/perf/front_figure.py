"""Draw the figure of the README from a campaign: paths and end poses of one trajectory, and all end position errors.

agvbench bench --out campaigns/front && python benchmarks/perf/front_figure.py campaigns/front docs/figures/front.svg
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

import agvbench
import agvbench.plot

TRAJECTORY = "7"


def main(directory: str, file: str) -> None:
    """Draw `file`."""
    campaign = agvbench.Campaign.open(directory)
    plt.rcParams["svg.hashsalt"] = "agvbench"
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(10.0, 3.2), layout="constrained")
    agvbench.plot.paths(left, campaign.select(trajectory=TRAJECTORY))
    errors = agvbench.pose_errors(campaign)
    agvbench.plot.end_poses(middle, errors, trajectory=TRAJECTORY)
    compared = agvbench.compare(errors, errors, conditions=("uncalibrated", "calibrated"), same_campaign=True)
    agvbench.plot.comparison(right, compared)
    for axes, title in ((left, "paths driven"), (middle, "end poses"), (right, "calibrated minus uncalibrated")):
        axes.set_title(title)
    figure.savefig(file, metadata={"Date": None} if Path(file).suffix == ".svg" else None)


if __name__ == "__main__":
    main(*sys.argv[1:])
