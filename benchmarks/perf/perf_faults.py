"""What comes of every fault, and how soon the vehicle stops: in simulation, and with the firmware in simavr.

Plays each fault of ``tests/faults/`` on every rig that it can befall. The reaction is how long the vehicle was told to
drive after the fault began: by commands to the plant in simulation, by the last pulse on the microcontroller's pin that
drives in simavr. ``--only TEXT`` plays those whose names contain TEXT; ``--docs`` prints the table of
``docs/reference/faults.md``, and ``--write`` writes it there.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "faults"))

from fault_record import Fault, Outcome, Then, all_faults  # noqa: E402  (found by the line above)

from agvbench.adapters.simavr.built import why_not_built  # noqa: E402

DOCUMENT = ROOT / "docs" / "reference" / "faults.md"
BEGIN, END = "<!-- table: python benchmarks/perf/perf_faults.py --write -->", "<!-- end of table -->"
RIGS = ("sim", "simavr", "live")


def play(fault: Fault, rigs: list[str]) -> dict[str, Outcome]:
    """Return what came of `fault`, by rig."""
    outcomes = {}
    for rig in rigs:
        if rig in fault.rigs:
            with tempfile.TemporaryDirectory() as folder:
                outcomes[rig] = fault.play(Path(folder), rig)
    return outcomes


def cell(fault: Fault, outcome: Outcome | None) -> str:
    """Return a reaction time in words."""
    if outcome is None:
        return "–"
    if fault.limit_s is None:
        return "not needed" if fault.then in (Then.GOES_ON, Then.REJECTS) else "by place" if outcome.said else "?"
    return "?" if outcome.reaction_s is None else f"{outcome.reaction_s:.2f} s"


def line(fault: Fault, outcomes: dict[str, Outcome]) -> str:
    """Return the row of the document."""
    said = next((outcome.said for outcome in outcomes.values() if outcome.said), "")
    limit = "–" if fault.limit_s is None else f"{fault.limit_s:g} s"
    cells = [fault.stage, fault.injected, str(fault.then), limit, *(cell(fault, outcomes.get(rig)) for rig in RIGS)]
    return f"| {' | '.join(cells)} | {f'`{shortened(said)}`' if said else '–'} |"


def shortened(said: str) -> str:
    """Return a message without what differs from time to time."""
    said = re.sub(r"\S+/campaign(?=:)", "DIR", re.sub(r"/dev/pts/\d+", "/dev/ttyACM0", said))
    return re.sub(r"tcp/127\.0\.0\.1:\d+", "tcp/127.0.0.1:7447", said).replace("|", "\\|")


def table(rows: list[tuple[Fault, dict[str, Outcome]]]) -> str:
    """Return the table of the document."""
    head = ["stage", "injected", "the vehicle", "stopped within", *(f"measured: {rig}" for rig in RIGS), "message"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *(line(fault, outcomes) for fault, outcomes in rows)])


def main() -> int:
    """Play, print and write; return 1 where a promise was not kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments, _ = parser.parse_known_args()
    rigs = [rig for rig in RIGS if rig == "sim" or not why_not_built()]
    rows, kept = [], True
    print(f"{'what':26s} {'bound':>8s} " + " ".join(f"{rig:>10s}" for rig in RIGS) + "  bound met?")
    for fault in all_faults():
        if arguments.only not in fault.name:
            continue
        outcomes = play(fault, rigs)
        broken = [f"{rig}: {promise}" for rig, outcome in outcomes.items() for promise in outcome.breaks(fault)]
        kept = kept and not broken
        rows.append((fault, outcomes))
        limit = "" if fault.limit_s is None else f"{fault.limit_s:g} s"
        cells = " ".join(f"{cell(fault, outcomes.get(rig)):>10s}" for rig in RIGS)
        print(f"{fault.name:26s} {limit:>8s} {cells}  {'; '.join(broken) or 'yes'}", flush=True)
    if arguments.docs:
        print(table(rows))
    if arguments.write and not arguments.only:
        text = DOCUMENT.read_text(encoding="utf-8")
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        DOCUMENT.write_text(f"{before}{BEGIN}\n\n{table(rows)}\n\n{END}{after}", encoding="utf-8")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
