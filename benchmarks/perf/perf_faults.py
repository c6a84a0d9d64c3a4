"""What comes of every fault, and how soon the vehicle stops: in simulation, and with the firmware in simavr.

Plays each fault of ``tests/faults/`` on every rig that it applies to. The reaction is how long the vehicle was driven
after the fault began: by commands to the plant in simulation, by the last pulse on the microcontroller's pin that
drives in simavr. ``--only TEXT`` plays those whose names contain TEXT; ``--keep FILE`` keeps what was
measured, and leaves out what is in it already; ``--write`` writes the table of ``docs/reference/faults.md``.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "faults"))

from fault_record import Fault, all_faults  # noqa: E402  (found by the line above)

from agvbench.adapters.simavr.firmware_files import why_not_built  # noqa: E402

DOCUMENT = ROOT / "docs" / "reference" / "faults.md"
BEGIN, END = "<!-- table: python benchmarks/perf/perf_faults.py --write -->", "<!-- end of table -->"
RIGS = ("sim", "simavr", "live")


Reactions = dict[str, float | None]
"""How soon the vehicle stopped [s], by rig."""


def play(fault: Fault, rigs: list[str]) -> tuple[Reactions, list[str]]:
    """Return how soon the vehicle stopped, and which requirements were violated."""
    reactions: Reactions = {}
    broken = []
    for rig in rigs:
        if rig in fault.rigs:
            with tempfile.TemporaryDirectory() as folder:
                outcome = fault.play(Path(folder), rig)
            reactions[rig] = outcome.reaction_s
            broken += [f"{rig}: {requirement}" for requirement in outcome.breaks(fault)]
    return reactions, broken


def cell(fault: Fault, reactions: Reactions, rig: str) -> str:
    """Return a reaction time in words."""
    if rig not in reactions:
        return "–"
    reaction_s = reactions[rig]
    return fault.instead if fault.limit_s is None or reaction_s is None else f"{reaction_s:.2f} s"


def line(fault: Fault, reactions: Reactions) -> str:
    """Return the row of the document."""
    limit = "–" if fault.limit_s is None else f"{fault.limit_s:g} s"
    cells = [fault.stage, fault.injected, str(fault.then), limit, *(cell(fault, reactions, rig) for rig in RIGS)]
    return f"| {' | '.join(cells)} | {f'`{fault.message}`' if fault.message else '–'} |"


def table(measured: dict[str, Reactions]) -> str:
    """Return the table of the document."""
    head = ["stage", "injected", "the vehicle", "stopped within", *RIGS, "message contains"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *(line(fault, measured.get(fault.name, {})) for fault in all_faults())])


def write(measured: dict[str, Reactions]) -> None:
    """Write the table into the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    DOCUMENT.write_text(f"{before}{BEGIN}\n\n{table(measured)}\n\n{END}{after}", encoding="utf-8")


def main() -> int:
    """Play, print and write; return 1 where a requirement was violated."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--keep", type=Path, metavar="FILE")
    parser.add_argument("--write", action="store_true")
    arguments, _ = parser.parse_known_args()
    kept: Path | None = arguments.keep
    measured: dict[str, Reactions] = json.loads(kept.read_text()) if kept is not None and kept.exists() else {}
    rigs = [rig for rig in RIGS if rig == "sim" or not why_not_built()]
    is_good = True
    print(f"{'what':26s} {'bound':>8s} " + " ".join(f"{rig:>15s}" for rig in RIGS) + "  bound met?")
    for fault in all_faults():
        if arguments.only not in fault.name or fault.name in measured:
            continue
        measured[fault.name], broken = play(fault, rigs)
        is_good = is_good and not broken
        limit = "" if fault.limit_s is None else f"{fault.limit_s:g} s"
        cells = " ".join(f"{cell(fault, measured[fault.name], rig):>15s}" for rig in RIGS)
        print(f"{fault.name:26s} {limit:>8s} {cells}  {'; '.join(broken) or 'yes'}", flush=True)
        if kept is not None:
            kept.write_text(json.dumps(measured))
    if arguments.write:
        write(measured)
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
