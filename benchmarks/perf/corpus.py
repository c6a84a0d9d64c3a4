"""A fixed corpus of simulated campaigns, and what each command says of it before and after a change of the code.

    python benchmarks/perf/corpus.py drive --corpus DIR             drive the campaigns that DIR lacks
    python benchmarks/perf/corpus.py answer --corpus DIR --out A    write what this version answers
    python benchmarks/perf/corpus.py differences A B                list the files that differ; 1 if there are any

The campaigns come from several simulators: two quiet vehicles that hide each thing that a blind trial hides
(`agvbench.simulator.hidden`), the default vehicle, and vehicles drawn at random. The DART recordings join them where
``$AGVBENCH_MEASURED`` or ``../shared/measured`` has them. ``--only TEXT`` takes entries with this in their names;
``--every N`` takes every N-th of them.
"""

from __future__ import annotations

import argparse
import contextlib
import filecmp
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
HIDDEN_SEEDS = (9500, 9501)
DRAWN_SEEDS = range(9510, 9518)
REPEATS = 4
EXCITATION = ("calibration", "trajectories", "step_response", "free_driving")
DIAGNOSES = "diagnoses"


def simulated() -> Iterator[tuple[str, list[str]]]:
    """Yield the name of each simulated campaign, and the options that drive it."""
    from agvbench.challenge.challenge import PAIRS
    from agvbench.simulator.hidden.catalogue import CATALOGUE, NOTHING

    for seed in HIDDEN_SEEDS:
        for spec in (NOTHING, *CATALOGUE, *PAIRS):
            yield f"hidden-{seed}-{spec}", [f"--plant=agvbench.simulator.hidden:{spec}", f"--seed={seed}"]
    for seed in DRAWN_SEEDS:
        yield f"drawn-{seed}", ["--plant=agvbench.simulator:random_plant", f"--seed={seed}"]
    for seed in (9520, 9521):
        yield f"default-{seed}", [f"--seed={seed}"]


def agvbench(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command of this checkout."""
    command = [sys.executable, "-c", PROGRAM, *arguments]
    # The width of tables is part of what is compared.
    width = {**os.environ, "COLUMNS": "120"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=width, cwd=ROOT)  # noqa: S603


def drive(corpus: Path, name: str, options: list[str]) -> str:
    """Drive one campaign into a directory that gets its name once it is complete."""
    under_way = corpus / f".{name}"
    shown = [*options, f"--repeats={REPEATS}", "--no-report", "--exchange=2", f"--out={under_way}"]
    done = agvbench("bench", *EXCITATION, *shown, *(["--resume"] if under_way.exists() else []))
    if done.returncode not in {0, 1}:
        return f"{name}: {(done.stderr or done.stdout)[-500:]}"
    under_way.rename(corpus / name)
    return f"{name}: driven"


def measured(corpus: Path) -> None:
    """Import the DART recordings where there are any: free driving in the place of runs from rest."""
    from perf_measured import recordings

    from agvbench.campaign import import_recordings

    files = recordings("dart")
    if files and not (corpus / "measured-dart").exists():
        import_recordings("dart", files, corpus / "measured-dart")
        print("measured-dart: imported", flush=True)


def chosen(names: Iterator[str], arguments: argparse.Namespace) -> list[str]:
    """Return the names that the options select."""
    return [name for name in names if arguments.only in name][:: arguments.every]


def drive_all(arguments: argparse.Namespace) -> int:
    """Drive what is missing."""
    corpus = Path(arguments.corpus)
    corpus.mkdir(parents=True, exist_ok=True)
    measured(corpus)
    wanted = dict(simulated())
    missing = [name for name in chosen(iter(wanted), arguments) if not (corpus / name).exists()]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for line in pool.map(partial(drive, corpus), missing, (wanted[name] for name in missing)):
            print(line, flush=True)
    return 0


def answer(out: Path, campaign: Path) -> str:
    """Write the diagnosis of one campaign as JSON, with its vehicle beside it."""
    from agvbench.campaign import Campaign
    from agvbench.diagnosis import diagnose

    written = out / DIAGNOSES / f"{campaign.name}.json"
    if written.exists():
        return f"{campaign.name}: known"
    began = time.process_time()
    try:
        found = diagnose(Campaign.open(campaign))
    except Exception as error:  # noqa: BLE001  (an error is an answer, too)
        written.write_text(f"{type(error).__name__}: {error}\n", encoding="utf-8")
        return f"{campaign.name}: {type(error).__name__}"
    if found.model is not None:
        found.model.save(written.with_suffix(".toml"))
    written.write_text(found.to_text(), encoding="utf-8")
    named = " + ".join(sorted(effect.name for effect in found.effects))
    return f"{campaign.name}: {found.verdict} {named} ({time.process_time() - began:.1f} s)"


def commands(corpus: Path, out: Path) -> None:
    """Write what other commands say: the thesis, two comparisons, plans, a calibration and a whole bench."""
    one, two = (str(corpus / f"hidden-{seed}-nothing") for seed in HIDDEN_SEEDS)
    asked = {
        "thesis": ["thesis", f"--json={out / 'thesis.json'}"],
        "compare": ["compare", one, two, f"--json={out / 'compare.json'}"],
        "conditions": ["compare", one, "--conditions", "uncalibrated", "calibrated"],
        "calibrate": ["calibrate", one, f"--out={out / 'calibrated.toml'}"],
        "effects": ["effects"],
        "plan": ["plan"],
        "bench": ["bench", "--seed=7", "--repeats=2", "--no-report", f"--out={out / 'bench'}"],
    }
    for name, arguments in asked.items():
        done = agvbench(*arguments)
        said = f"exit code {done.returncode}\n{done.stdout}{done.stderr}".replace(str(out), "OUT")
        (out / f"{name}.txt").write_text(said, encoding="utf-8")
        print(f"{name}: exit code {done.returncode}", flush=True)


def answer_all(arguments: argparse.Namespace) -> int:
    """Write the answers of this version."""
    corpus, out = Path(arguments.corpus).resolve(), Path(arguments.out).resolve()
    (out / DIAGNOSES).mkdir(parents=True, exist_ok=True)
    names = chosen(iter(sorted(path.name for path in corpus.glob("[!.]*"))), arguments)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for line in pool.map(partial(answer, out), [corpus / name for name in names]):
            print(line, flush=True)
    if not arguments.diagnoses_only:
        commands(corpus, out)
    return 0


def differences(arguments: argparse.Namespace) -> int:
    """List the files of two sets of answers that are not the same bytes."""
    before, after = Path(arguments.before), Path(arguments.after)
    sides = [{file.relative_to(side) for file in side.rglob("*") if file.is_file()} for side in (before, after)]
    both = sorted(sides[0] & sides[1])
    differing = [str(file) for file in both if not filecmp.cmp(before / file, after / file, shallow=False)]
    for name in differing:
        print(f"differs: {name}")
    for label, names in (("only before", sides[0] - sides[1]), ("only after", sides[1] - sides[0])):
        for name in sorted(names):
            print(f"{label}: {name}")
    print(f"{len(both) - len(differing)} of {len(both)} files are the same bytes")
    return 1 if differing else 0


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    driving, answering, differing = (verbs.add_parser(name) for name in ("drive", "answer", "differences"))
    for verb in (driving, answering):
        verb.add_argument("--corpus", required=True)
        verb.add_argument("--only", default="")
        verb.add_argument("--every", type=int, default=1)
        verb.add_argument("--jobs", type=int, default=os.cpu_count())
    answering.add_argument("--out", required=True)
    answering.add_argument("--diagnoses-only", action="store_true")
    differing.add_argument("before")
    differing.add_argument("after")
    driving.set_defaults(run=drive_all)
    answering.set_defaults(run=answer_all)
    differing.set_defaults(run=differences)
    arguments = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt):
        return int(arguments.run(arguments))
    return 130


if __name__ == "__main__":
    sys.exit(main())
