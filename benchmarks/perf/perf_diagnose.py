"""How long a whole diagnosis takes, on one core: by the number of runs, and by what is hidden.

Campaigns are driven on plants that hide nothing, one effect, two, six, and one from outside the library
(`agvbench.simulator.hidden`). Time is that of the process: a shared machine does not make it longer. There is no peer
that does the same, so the figures stand alone, beside the bounds that were set: 5 s where nothing is found, 12 s for
one or two names, 60 s for more, and 40 s for UNKNOWN. The yardstick is the time that a fixed piece of work takes just
before and after: one virtual machine may be half as fast on another day, and times are compared by it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import numpy as np

from agvbench.campaign import Campaign, CampaignHeader
from agvbench.diagnosis import Diagnosis, Verdict, diagnose
from agvbench.types import Run

BENCHMARKS = ("calibration", "trajectories", "step_response", "free_driving")
SIX = "_and_".join(
    ("steering_lag", "speed_lag", "axle_coupling", "cornering_speed_loss", "reverse_steering_gain", "floor_tilt")
)
HIDDEN = ("nothing", "steering_lag", "steering_lag_and_lateral_slip", SIX, "slow_patch")
ASKED = 170
SHARES = (0.5, 0.75, 1.0)
BOUND_S = {Verdict.ADEQUATE: 5.0, Verdict.NOT_IDENTIFIABLE: 5.0, Verdict.UNKNOWN: 40.0}
FEW, BOUND_OF_FEW_S, BOUND_OF_MANY_S = 2, 12.0, 60.0
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"


@dataclass(frozen=True)
class Part:
    """Some of a campaign's runs."""

    header: CampaignHeader
    runs: list[Run]

    def __iter__(self) -> Iterator[Run]:
        """Iterate over the runs."""
        return iter(self.runs)


def drive(hidden: str, repeats: int, folder: Path) -> Campaign:
    """Return a campaign with a plant that hides something."""
    options = [f"--plant=agvbench.simulator.hidden:{hidden}", "--seed=41", f"--repeats={repeats}", "--no-report"]
    command = [sys.executable, "-c", PROGRAM, "bench", *BENCHMARKS, *options, f"--out={folder / hidden}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode not in {0, 1}:
        raise SystemExit(f"{hidden}: {done.stderr[-2000:]}")
    return Campaign.open(folder / hidden)


def parts_of(campaign: Campaign, repeats: int) -> list[Part]:
    """Return the first 170 runs in order of their repeats, and those of the first half, three quarters, all repeats."""
    runs = list(campaign)
    counts = [ASKED, *(sum(run.repeat < max(2, share * repeats) for run in runs) for share in SHARES)]
    first = sorted(range(len(runs)), key=lambda k: (runs[k].repeat, k))
    return [Part(campaign.header, [runs[k] for k in sorted(first[:count])]) for count in counts]


def bound_s(found: Diagnosis) -> float:
    """Return the bound that was set for an answer [s]."""
    return BOUND_S.get(found.verdict, BOUND_OF_FEW_S if len(found.effects) <= FEW else BOUND_OF_MANY_S)


def yardstick() -> float:
    """Return the CPU time [s] of work that never changes: plain Python, and small matrices."""
    matrices = np.random.default_rng(0).normal(size=(400, 60, 40))
    began = time.process_time()
    total = 0
    for k in range(4_000_000):
        total += k & 3
    for matrix in matrices:
        np.linalg.lstsq(matrix, matrix[:, 0], rcond=None)
        np.einsum("ij,ik->jk", matrix, matrix)
    return time.process_time() - began


def time_parts(hidden: str, campaign: Campaign, repeats: int) -> None:
    """Print a row for each part of a campaign."""
    for k, part in enumerate(parts_of(campaign, repeats)):
        if k == 0:
            diagnose(part)  # compiles
        before, began = yardstick(), time.process_time()
        found = diagnose(part)
        taken = time.process_time() - began
        scale = 0.5 * (before + yardstick())
        bound = bound_s(found)
        names = " ".join(effect.name for effect in found.effects)
        title = "six" if hidden == SIX else hidden
        row = f"{title:34s} {len(part.runs):5d} {taken:6.1f} s  ≤ {bound:2.0f} s"
        met = "yes" if taken <= bound else "no"
        print(f"{row}  {met:4s}  {scale:7.2f} s  {found.verdict} {names}", flush=True)


def time_tree(tree: Path, hidden: str, repeats: int, folder: Path) -> None:
    """Print the rows of another version of the package on the same campaign.

    The version is in a process of its own: its modules have the names of ours.
    """
    print(f"version in {tree}:", flush=True)
    command = [sys.executable, __file__, "--campaign", str(folder / hidden), "--hidden", hidden]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    subprocess.run([*command, f"--repeats={repeats}"], env=environment, check=True)  # noqa: S603


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=8, help="of each trajectory (default 8)")
    parser.add_argument("--hidden", nargs="+", default=list(HIDDEN), help=f"what to hide (default {' '.join(HIDDEN)})")
    parser.add_argument("--against", type=Path, help="a tree of another version, timed on each campaign in turn")
    parser.add_argument("--campaign", type=Path, help="time this campaign, driven before, with no heading")
    arguments = parser.parse_args()
    if arguments.campaign:
        time_parts(arguments.hidden[0], Campaign.open(arguments.campaign), arguments.repeats)
        return
    print(f"{'hidden':34s} {'runs':>5s} {'ours':>8s}  {'bound':>7s}  met?  yardstick  answer")
    with tempfile.TemporaryDirectory() as folder:
        for hidden in arguments.hidden:
            time_parts(hidden, drive(hidden, arguments.repeats, Path(folder)), arguments.repeats)
            if arguments.against:
                time_tree(arguments.against, hidden, arguments.repeats, Path(folder))


if __name__ == "__main__":
    main()
