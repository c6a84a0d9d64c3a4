"""Export the poses of a campaign as TUM files.

Writes driven/RUN.tum and planned/RUN.tum: time since the first command, position and heading (as a quaternion) in the
start frame of the run, a pose per line. evo and other programs read this format.

examples:
  agvbench export campaigns/tonight --out tonight-tum
  evo_ape tum tonight-tum/planned/trajectory-5-calibrated-r01.tum tonight-tum/driven/trajectory-5-calibrated-r01.tum
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "export the poses of a campaign as TUM files"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``agvbench export``."""
    parser.add_argument("campaign", metavar="DIR", type=Path, help="campaign directory")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="where to write")


def run(arguments: argparse.Namespace) -> int:
    """Write the files and print how many."""
    from agvbench.reporting.progress import track
    from agvbench.workflows.export_tum import export_tum

    done = export_tum(arguments.campaign, arguments.out, track=lambda runs: track(runs, len(runs), what="writing runs"))
    print(f"wrote {len(done.files)} files to {arguments.out}")
    if done.left_out:
        print(f"left out, not seen at rest before they began: {', '.join(done.left_out)}")
    return 0
