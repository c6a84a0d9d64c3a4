"""Export the runs of a campaign as files that other programs read.

tum: driven/RUN.tum and planned/RUN.tum, with the time since the first command, position and heading (as a quaternion)
in the start frame of the run, a pose per line. evo and other programs read this format.

mcap: a bag RUN/ of ROS 2 with poses, commands, plan and target of the run in the floor frame, which Foxglove opens and
ros2 bag plays, and import.toml, with which agvbench import reads the bags again. It needs the extra ros:
pip install 'agvbench[ros]'.

examples:
  agvbench export campaigns/tonight --out tonight-tum
  evo_ape tum tonight-tum/planned/trajectory-5-calibrated-r01.tum tonight-tum/driven/trajectory-5-calibrated-r01.tum
  agvbench export campaigns/tonight --format mcap --out tonight-mcap
  agvbench import --mapping tonight-mcap/import.toml tonight-mcap/*/ --out campaigns/again
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "export the runs of a campaign as TUM files or as bags of ROS 2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench export``."""
    parser.add_argument("campaign", metavar="DIR", type=Path, help="campaign directory")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="where to write")
    parser.add_argument("--format", choices=("tum", "mcap"), default="tum", help="what to write (default: tum)")


def run(arguments: argparse.Namespace) -> int:
    """Write the files and print how many."""
    from agvbench.reporting.progress import track
    from agvbench.workflows.exchange.export_mcap import MAPPING_FILE, export_mcap
    from agvbench.workflows.exchange.export_tum import export_tum

    is_mcap = arguments.format == "mcap"
    export = export_mcap if is_mcap else export_tum
    done = export(arguments.campaign, arguments.out, track=lambda runs: track(runs, len(runs), what="writing runs"))
    written = f"{len(done.files) - 1} bags and {MAPPING_FILE}" if is_mcap else f"{len(done.files)} files"
    print(f"wrote {written} to {arguments.out}")
    if done.left_out:
        what = "without plan and target" if is_mcap else "left out"
        print(f"{what}, not seen at rest before they began: {', '.join(done.left_out)}")
    return 0
