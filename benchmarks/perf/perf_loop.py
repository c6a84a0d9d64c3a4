"""What ``agvbench loop`` leaves of biases: the default vehicle, and drawn ones with hidden effects, a loop each.

A cell is a trajectory and a signed component of the end pose's error: along, across, heading. It is met if an
equivalence test at the 5 % level puts the bias under ``corrected`` within ± 1 standard deviation of a repeat; asked for
are 90 % of the cells. The same count over the thesis' Δs and Δδ, which cannot see a bias across, follows. A bias of
zero is not always *shown* to be within: with 10 repeats in some five of six cells, with 30 in nearly all.
``--plants 20 --repeats 30`` is the whole measurement, of two to five minutes per plant; ``--only NAME …`` chooses what
is hidden, ``--keep DIR`` keeps the loops and goes on with those that are there: finished ones are only analysed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import mean

from scipy.stats import binomtest

from agvbench.campaign import Campaign
from agvbench.loop.before_after import (
    BeforeAfter,
    EndPosition,
    before_after,
    counts,
    end_positions,
    root_mean_square_bias,
)
from agvbench.simulator.hidden import sampled_spec
from agvbench.statistics import pose_errors
from agvbench.statistics.equivalence import Bias
from agvbench.statistics.quantities import COMPONENTS, DISTANCE, THESIS

FIRST_SEED = 1000
ASKED = 0.90
CELLS, OLD_CELLS = "along, across, heading", "Δs, Δδ"
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
DEFAULT = ("default", "agvbench.simulator:make_plant", 0)


@dataclass(frozen=True)
class Driven:
    """One loop: what was hidden, what was answered, and the biases: of the components, and of Δs and Δδ."""

    name: str
    answer: str
    rows: list[BeforeAfter]
    thesis: list[BeforeAfter]
    ends: list[EndPosition]


def _sampled(plants: int, first_seed: int) -> Iterator[tuple[str, str, int]]:
    seed = first_seed
    while plants:
        spec = sampled_spec(seed)
        if spec != "nothing":
            plants -= 1
            yield spec, f"agvbench.simulator.hidden:{spec}", seed
        seed += 1


def _go_round(name: str, plant: str, seed: int, repeats: int, folder: Path, *, model_only: bool) -> Driven:
    out = folder / f"{name}-{seed}"
    # A longer exchange is the same drive, sooner.
    begun = (out / "loop.toml").exists()
    options = ["--resume"] if begun else [f"--repeats={repeats}", f"--seed={seed}", "--exchange=2"]
    options += ["--model-only"] if model_only else []
    command = [sys.executable, "-c", PROGRAM, "loop", f"--plant={plant}", *options, f"--out={out}"]
    if not (out / "report.html").exists():
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own program
        if done.returncode:
            return Driven(f"{name} {seed}", f"failed: {done.stderr.strip()[-200:]}", [], [], [])
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    named = ", ".join(effect["name"] for effect in found["effects"])
    errors = pose_errors(Campaign.open(out / "after"))
    tables = before_after(errors), before_after(errors, THESIS), end_positions(errors)
    return Driven(f"{name} {seed}", f"{found['verdict']} {named}".strip(), *tables)


def _report(driven: Driven) -> None:
    conditions = ("uncalibrated", "calibrated", "corrected")
    medians = [[end.median_mm[c] for end in driven.ends if c in end.median_mm] for c in conditions]
    parts = ["end position " + " → ".join(f"{mean(found):.1f}" for found in medians if found) + " mm"]
    for rows, quantities in ((driven.rows, COMPONENTS), (driven.thesis, (DISTANCE,))):
        for quantity in quantities:
            biases = [root_mean_square_bias(rows, quantity, c) for c in conditions]
            moved = " → ".join(f"{bias:.{quantity.digits}f}" for bias in biases)
            parts.append(f"{quantity.symbol} {moved} {quantity.unit}")
    met = "; ".join(f"{_counted(rows)} of {what}" for rows, what in ((driven.rows, CELLS), (driven.thesis, OLD_CELLS)))
    print(f"{driven.name:42s} {met}  bias {'; '.join(parts)}  [{driven.answer}]", flush=True)


def _counted(rows: list[BeforeAfter]) -> str:
    found = counts(rows)
    return f"{found[Bias.WITHIN]} of {len(rows)} within, {found[Bias.BEYOND]} beyond"


def _report_cells(driven: Driven) -> None:
    for row in (*driven.rows, *(row for row in driven.thesis if row.quantity == DISTANCE)):
        biases = "  ".join(f"{c} {e.bias:8.2f} ± {e.sd:5.2f}" for c, e in row.by_condition.items())
        verdict = row.corrected.verdict if row.corrected else "not driven"
        print(f"    {row.trajectory:3s} {row.quantity.symbol:13s} {row.quantity.unit:3s} {biases}  {verdict}")


def _print_total(what: str, rows: list[BeforeAfter]) -> None:
    within, cells = counts(rows)[Bias.WITHIN], len(rows)
    bounds = binomtest(within, cells).proportion_ci(method="exact")
    met = "yes" if within / cells >= ASKED else "no"
    share = f"{within} of {cells}: {within / cells:.1%}"
    print(f"{what:40s} | {share:17s} | {ASKED:.0%}   | {bounds.low:.1%} to {bounds.high:.1%} | {met}")


def main() -> None:
    """Go round the loops and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plants", type=int, default=2, help="drawn plants with something hidden (default 2)")
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="hide these instead, each with the first seed")
    parser.add_argument("--model-only", action="store_true", help="leave aims alone, as the loop's option does")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="keep the loops there")
    parser.add_argument("--jobs", type=int, default=1, help="loops at a time (default 1)")
    parser.add_argument("--cells", action="store_true", help="print every trajectory")
    given = parser.parse_args()
    wanted = [DEFAULT, *_sampled(given.plants, given.first_seed)]
    if given.only:
        wanted = [(name, f"agvbench.simulator.hidden:{name}", given.first_seed) for name in given.only]
    with contextlib.ExitStack() as stack:
        folder = given.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        pool = stack.enter_context(ThreadPoolExecutor(given.jobs))
        go_round = partial(_go_round, repeats=given.repeats, folder=folder, model_only=given.model_only)
        loops = []
        for driven in pool.map(go_round, *zip(*wanted, strict=True)):
            loops.append(driven)
            _report(driven)
            if given.cells:
                _report_cells(driven)
    if any(loop.rows for loop in loops):
        print(f"\n{'corrected bias within ± 1 sd':40s} | ours              | asked | 95 % bounds     | bound met?")
        _print_total(CELLS, [row for loop in loops for row in loop.rows])
        _print_total(OLD_CELLS, [row for loop in loops for row in loop.thesis])


if __name__ == "__main__":
    main()
