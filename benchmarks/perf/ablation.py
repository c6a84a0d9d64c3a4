"""What each part of the diagnosis pays: every part switched off in turn on a fixed corpus of campaigns.

    python benchmarks/perf/corpus.py drive --corpus DIR                    drive the campaigns
    python benchmarks/perf/ablation.py run --corpus DIR --out OUT          diagnose them with and without each part
    python benchmarks/perf/ablation.py table --out OUT                     the table: what is lost and gained

A part is a function, and what takes its place when it is switched off. While a campaign is diagnosed with every part,
each call of a part is compared with what would take its place. A part that made no difference there cannot change the
answer, so that the campaign is diagnosed without it only where it did. ``--only TEXT`` takes parts with this in their
names, ``--campaigns TEXT`` campaigns.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial, wraps
from pathlib import Path
from typing import Any

os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import numpy as np

BASE = "every part"
_POSITION = "position_rms_mm"


@dataclass(frozen=True)
class Part:
    """A part of the diagnosis.

    ``module`` and ``name`` say where it is, ``instead`` takes its place when it is switched off, and ``differs`` says
    of a result and its arguments whether that would have been another. ``watched`` is the function whose results are
    judged so, where it is not the part itself.
    """

    module: str
    name: str
    instead: Any
    differs: Callable[..., bool]
    watched: str = ""


def _is_not_first(found: Any, *arguments: Any, **_: Any) -> bool:
    """Whether a result is another than the first argument, or than the same of it in a tuple."""
    return (found[0] if isinstance(found, tuple) else found) is not arguments[0]


def _is_something(found: Any, *_: Any, **__: Any) -> bool:
    return found is not None


def _is_false(found: Any, *_: Any, **__: Any) -> bool:
    return not found


def _is_true(found: Any, *_: Any, **__: Any) -> bool:
    return bool(found)


def _first(*arguments: Any, **_: Any) -> Any:
    return arguments[0]


def _first_two(first: Any, second: Any, *_: Any, **__: Any) -> tuple[Any, Any]:
    return first, second


def _cross_validated_gain(model: Any, other: Any) -> float:
    return float(other.deviance - model.deviance)


def _selection_alone(selection: Any, selector: Any) -> tuple[Any, None, Any]:
    return selection, None, selector


def _first_start(models: Any, current: Any, predictor: Any, starts: Any, bounds: Any, least: Any) -> Any:
    return models._first_steps(current, predictor, starts[0], bounds)


def _where_it_is(solver: Any, state: Any, evaluation: Any, *_: Any, **__: Any) -> tuple[Any, Any]:
    return state, evaluation


def _begun_elsewhere(found: Any, models: Any, current: Any, predictor: Any, starts: Any, bounds: Any, *_: Any) -> bool:
    first = models._first_steps(current, predictor, starts[0], bounds)
    return bool(first.loss.sum() != found.loss.sum())


_SELECTION = "agvbench.diagnosis.selection."
_DISCREPANCY = "agvbench.diagnosis.discrepancy.stepwise"
_OPTIMISER = "agvbench.diagnosis.estimation.levenberg_marquardt"

PARTS: dict[str, Part] = {
    "a noticeable change of the prediction": Part(
        f"{_SELECTION}stepwise", "Selector._changes_prediction", lambda *_: True, _is_false
    ),
    "a gain without the extreme groups of runs": Part(
        f"{_SELECTION}stepwise",
        "trimmed_gain",
        lambda gain, *_: float(np.sum(gain)),
        lambda found, gain, *_: found <= 0.0 < float(np.sum(gain)),
    ),
    "Wald's test of the parameters": Part(f"{_SELECTION}stepwise", "differs_from_null", lambda *_: True, _is_false),
    "a gain of fit as well": Part(
        f"{_SELECTION}fitted_models",
        "ScoredModel.gain_over",
        _cross_validated_gain,
        lambda found, model, other: found < 20.0 and other.deviance - model.deviance > max(found, 12.0),
    ),
    "the correction for many candidates": Part(
        f"{_SELECTION}stepwise",
        "Selector.min_gain",
        property(lambda _: 12.0),
        lambda found, selector, without, with_it: not found and with_it.gain_over(without) > 12.0,
        watched="Selector.meets_criterion",
    ),
    "a second start beside which maps are fitted": Part(
        f"{_SELECTION}fitted_models", "FittedModels._preliminary_fit", _first_start, _begun_elsewhere
    ),
    "the choice of the initial steering": Part(
        f"{_SELECTION}initial_steering", "choose_initial_steering", _first, _is_not_first
    ),
    "the initial steering reconsidered": Part(
        f"{_SELECTION}initial_steering", "reconsider_initial_steering", _first_two, _is_not_first
    ),
    "the initial steering reconsidered with variants and terms": Part(
        f"{_SELECTION}variants", "prefers_other_initial_steering", lambda *_: False, _is_true
    ),
    "variants of equations": Part(f"{_SELECTION}variants", "select_variants", _first, _is_not_first),
    "discrepancy terms": Part(
        _DISCREPANCY, "add_term_and_reconsider", _selection_alone, lambda found, *_: found[1] is not None
    ),
    "effects that a term had masked": Part(
        _DISCREPANCY,
        "_add_masked_effects",
        lambda wide, current: current,
        lambda found, wide, current: found is not current,
    ),
    "a term in place of an effect": Part(_DISCREPANCY, "_term_in_place_of_effect", lambda *_: None, _is_something),
    "the validation gate": Part(f"{_SELECTION}validation", "validated", _first_two, _is_not_first),
    "a way off the likelihood's plateaus": Part(
        _OPTIMISER,
        "LevenbergMarquardt.leave_plateaus",
        _where_it_is,
        lambda found, solver, state, *_, **__: found[0] is not state,
    ),
    "non-monotone steps": Part(_OPTIMISER, "LevenbergMarquardt.non_monotone_steps", lambda *_: None, _is_something),
    "the test for a periodic disturbance": Part(
        "agvbench.diagnosis.residuals.periodic", "periodic_disturbance", lambda *_: None, _is_something
    ),
}


def _owners(part: Part, name: str) -> Iterator[tuple[Any, str, Any]]:
    """Yield every place that refers to a function: its class, or each module that imported it; with what is there."""
    module = sys.modules[part.module]
    owner, _, attribute = name.rpartition(".")
    if owner:
        holder = getattr(module, owner)
        yield holder, attribute, holder.__dict__[attribute]
        return
    original = getattr(module, attribute)
    for other in [m for n, m in sys.modules.items() if n.startswith("agvbench.diagnosis")]:
        if other.__dict__.get(attribute) is original:
            yield other, attribute, original


@contextlib.contextmanager
def replaced(part: Part, name: str, by: Callable[[Any], Any]) -> Iterator[None]:
    """Put ``by(original)`` in the place of a function while the block runs."""
    places = list(_owners(part, name))
    for owner, attribute, original in places:
        setattr(owner, attribute, by(original))
    try:
        yield
    finally:
        for owner, attribute, original in places:
            setattr(owner, attribute, original)


def _probe(part: Part, mattered: Callable[[], None]) -> Callable[[Any], Any]:
    def around(original: Any) -> Any:
        @wraps(original)
        def call(*arguments: Any, **named: Any) -> Any:
            found = original(*arguments, **named)
            if part.differs(found, *arguments, **named):
                mattered()
            return found

        return call

    return around


def diagnosed(campaign: Path, without: str) -> dict[str, Any]:
    """Return the answer for a campaign, and with every part how often each would have made a difference."""
    from agvbench.campaign import Campaign
    from agvbench.diagnosis import diagnose

    counts = dict.fromkeys(PARTS, 0)
    with contextlib.ExitStack() as stack:
        for name, part in PARTS.items():
            if without == BASE:

                def mattered(name: str = name) -> None:
                    counts[name] += 1

                stack.enter_context(replaced(part, part.watched or part.name, _probe(part, mattered)))
            elif name == without:
                stack.enter_context(replaced(part, part.name, lambda _, part=part: part.instead))
        began = time.process_time()
        try:
            answer = _answer(campaign.name, diagnose(Campaign.open(campaign)))
        except Exception as error:  # noqa: BLE001  (an error is an answer, too)
            answer = {"verdict": "ERROR", "named": [], "error": f"{type(error).__name__}: {error}"}
    answer["seconds"] = time.process_time() - began
    return answer | ({"mattered": counts} if without == BASE else {})


def _answer(name: str, found: Any) -> dict[str, Any]:
    """Return the answer, judged where the truth is known: hidden-SEED-SPEC."""
    from agvbench.challenge.challenge import unsealed
    from agvbench.challenge.scores import coverings, plain
    from agvbench.simulator.hidden import sealed_truth

    held = found.held_out.errors.get(_POSITION, {}) if found.held_out else {}
    answer: dict[str, Any] = {
        "verdict": str(found.verdict),
        "named": sorted(effect.name for effect in found.effects),
        "before": held.get("before", math.nan),
        "after": held.get("after", math.nan),
    }
    if name.startswith("hidden-"):
        _, seed, spec = name.split("-", 2)
        trial = unsealed(spec, int(seed), sealed_truth(spec, int(seed)), found, 0.0)
        answer |= {"right": _right(trial), "false": list(trial.false_names), "removed": trial.removed}
        answer |= {"covered": coverings(trial), "trial": plain(asdict(trial))}
    return answer


def _right(trial: Any) -> bool:
    """Whether the answer is the best that such a campaign allows; the questions are those of the blind trials."""
    if not trial.hidden:
        return bool(trial.verdict == "ADEQUATE")
    if trial.false_names or (trial.absorbed and len(trial.hidden) == 1):
        return not trial.false_names
    if trial.outside and not trial.library_names:
        return bool(trial.verdict == "UNKNOWN" and trial.depends_on and trial.depends_on[0] in trial.covariates)
    if trial.outside:
        return bool(trial.verdict == "UNKNOWN" and trial.is_right)
    return bool(trial.is_right and trial.is_final)


def _one(corpus: Path, out: Path, task: tuple[str, str]) -> str:
    campaign, without = task
    file = _file(out, without) / f"{campaign}.json"
    answer = diagnosed(corpus / campaign, without)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return f"{without}: {campaign}: {answer['verdict']} {' + '.join(answer['named'])} ({answer['seconds']:.0f} s)"


def _file(out: Path, without: str) -> Path:
    return out / without.replace(" ", "_").replace("'", "").replace(",", "")


def answers(out: Path, without: str) -> dict[str, dict[str, Any]]:
    """Return what was answered without a part, by campaign."""
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(_file(out, without).glob("*"))}


def run(arguments: argparse.Namespace) -> int:
    """Diagnose every campaign with every part, then without each those where it mattered; goes on where it stopped."""
    corpus, out = Path(arguments.corpus), Path(arguments.out)
    names = [one.name for one in sorted(corpus.iterdir()) if arguments.campaigns in one.name and one.name[0] != "."]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for without in (BASE, *(name for name in PARTS if arguments.only in name)):
            known = answers(out, without)
            active = names if without == BASE else [n for n in names if answers(out, BASE)[n]["mattered"][without]]
            tasks = [(name, without) for name in active if name not in known]
            for line in pool.map(partial(_one, corpus, out), tasks):
                print(line, flush=True)
    return 0


def _changes(base: dict[str, Any], other: dict[str, Any]) -> tuple[int, int, int]:
    """Return whether the answer differs, is lost, is gained."""
    same = all(base.get(key) == other.get(key) for key in ("verdict", "named"))
    was, now = base.get("right"), other.get("right")
    return int(not same), int(was is True and now is not True), int(was is False and now is True)


def _larger(base: dict[str, Any], other: dict[str, Any]) -> float:
    """Return the logarithm of how many times larger the test error is."""
    was, now = base.get("after"), other.get("after")
    return math.log(now / was) if was and now and math.isfinite(was) and math.isfinite(now) else 0.0


def table(arguments: argparse.Namespace) -> int:
    """Print, part by part, what is lost and gained without it."""
    out = Path(arguments.out)
    base = answers(out, BASE)
    judged = [one for one in base.values() if "right" in one]
    print(
        f"{len(base)} campaigns, of {len(judged)} the truth is known, of these {sum(o['right'] for o in judged)} right"
    )
    print("| switched off | mattered in | other answer | lost | gained | test error, times (median; most) | time |")
    print("|---|---|---|---|---|---|---|")
    for name in PARTS:
        without = answers(out, name)
        if not without:
            print(f"| {name} | 0 | | | | | |")
            continue
        changes = np.array([_changes(base[one], other) for one, other in without.items()]).sum(axis=0)
        larger = np.exp([_larger(base[one], other) for one, other in without.items()])
        seconds = sum(one["seconds"] for one in without.values()) / sum(base[one]["seconds"] for one in without)
        print(
            f"| {name} | {len(without)} | {changes[0]} | {changes[1]} | {changes[2]} "
            f"| {np.median(larger):.2f}; {larger.max():.2f} | {seconds:.2f} |"
        )
    return 0


def main() -> int:
    """Run the command of the line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("run")
    one.add_argument("--corpus", required=True)
    one.add_argument("--only", default="")
    one.add_argument("--campaigns", default="")
    one.add_argument("--jobs", type=int, default=os.cpu_count())
    one.set_defaults(command=run)
    two = commands.add_parser("table")
    two.set_defaults(command=table)
    for each in (one, two):
        each.add_argument("--out", required=True)
    arguments = parser.parse_args()
    done: int = arguments.command(arguments)
    return done


if __name__ == "__main__":
    sys.exit(main())
