"""Fuzz every target for its share of the time, and print what came of it.

``python -m fuzz`` takes 30 minutes of processor time, ``python -m fuzz --minutes 1 bus_message`` one for a target. What
is found goes to ``.fuzz/TARGET`` and is gone on with; an input that does harm to ``.fuzz/TARGET-crash-…``, and the exit
code is 1. Such an input belongs into ``fuzz/corpus/TARGET`` once what it found is fixed.
"""

from __future__ import annotations

import argparse
import re
import resource
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from fuzz.target import CORPUS, Target, targets

WORK = Path(".fuzz")
_HANG_S, _MEMORY_MB = 10, 2048
_ENOUGH_S = 1.0


class Outcome(NamedTuple):
    """What a target's fuzzing came to: inputs fed, processor time, the peak of memory, and what it died of."""

    inputs: int
    cpu_s: float
    memory_mb: int
    failure: str


def begin(target: type[Target]) -> Path:
    """Return the target's working folder, with what is right in it."""
    folder = WORK / target.name
    folder.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target().seeds()):
        (folder / f"seed-{number:03d}").write_bytes(seed)
    return folder


def fuzz(target: type[Target], seconds: float) -> Outcome:
    """Feed the target until it has used `seconds` of processor time, or fails."""
    folder, kept = begin(target), CORPUS / target.name
    inputs, used_s, memory_mb = 0, 0.0, 0
    while seconds - used_s > _ENOUGH_S:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(  # noqa: S603  (our own program)
            [
                sys.executable, "-m", "fuzz.one", target.name, str(folder), *[str(kept)] * kept.is_dir(),
                f"-max_total_time={max(1, round(seconds - used_s))}", f"-max_len={target.longest}",
                f"-timeout={_HANG_S}", f"-rss_limit_mb={_MEMORY_MB}", "-print_final_stats=1",
                f"-artifact_prefix={WORK / target.name}-",
            ],
            check=False, stderr=subprocess.PIPE, text=True, errors="replace",
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used_s += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        inputs += _number("number_of_executed_units", done.stderr)
        memory_mb = max(memory_mb, _number("peak_rss_mb", done.stderr))
        if done.returncode:
            return Outcome(inputs, used_s, memory_mb, done.stderr[-6000:])
    return Outcome(inputs, used_s, memory_mb, "")


def _number(name: str, text: str) -> int:
    found = re.search(rf"stat::{name}:\s+(\d+)", text)
    return int(found[1]) if found else 0


def main() -> int:
    """Fuzz; return 1 if an input did harm."""
    known = targets()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=" ".join(known))
    parser.add_argument("--minutes", type=float, default=30.0, help="of processor time (default: %(default)g)")
    arguments = parser.parse_args()
    if unknown := set(arguments.targets) - set(known):
        parser.error(f"no such target: {' '.join(sorted(unknown))} (limit: {' '.join(known)})")
    chosen = [name for name in arguments.targets or known if not known[name].missing()]
    for name in sorted(set(arguments.targets or known) - set(chosen)):
        print(f"{name}: left out: {known[name].missing()}", file=sys.stderr)
    outcomes = []
    print(f"{'target':20s} {'inputs':>12s} {'a second':>9s} {'CPU s':>7s} {'MB':>5s}  result", flush=True)
    for name in chosen:
        one = fuzz(known[name], 60.0 * arguments.minutes / len(chosen))
        outcomes.append(one)
        result = "an input did harm" if one.failure else "no crash, hang or growth"
        rate = one.inputs / max(one.cpu_s, 1e-9)
        print(f"{name:20s} {one.inputs:12,d} {rate:9,.0f} {one.cpu_s:7.1f} {one.memory_mb:5d}  {result}", flush=True)
        if one.failure:
            print(one.failure, file=sys.stderr)
    print(f"{'all':20s} {sum(o.inputs for o in outcomes):12,d} {'':9s} {sum(o.cpu_s for o in outcomes):7.1f}")
    return int(any(one.failure for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
