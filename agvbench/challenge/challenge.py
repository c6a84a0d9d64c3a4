"""``agvbench challenge``: drive plants with a sealed truth, diagnose, unseal, score."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.challenge.campaigns import TrialKind, campaigns_folder, driven_campaign
from agvbench.challenge.scores import Scores, plain, score
from agvbench.challenge.trial import Trial
from agvbench.errors import FileError, FlagError, PlantError
from agvbench.executors import Executor, ExecutorOptions, Failed, Outcome, Task, cause_of, open_executor
from agvbench.simulator.hidden import SealedTruth, indistinguishable_effects, sealed_truth
from agvbench.simulator.hidden.catalogue import AND, NOTHING, catalogue, recipes
from agvbench.simulator.hidden.sampling import vehicle_of
from agvbench.text_files import read_json
from agvbench.types import Kinematics
from agvbench.workflows.output_files import write_file

if TYPE_CHECKING:
    from agvbench.diagnosis import Diagnosis

_POSITION = "position_rms_mm"
_MOST_SEEDS = 100_000
_ERROR = "ERROR"
PAIRS = (
    "steering_lag_and_lateral_slip", "speed_lag_and_cornering_speed_loss", "axle_coupling_and_battery_droop",
    "actuation_delay_and_reverse_steering_gain", "steering_lag_and_slow_patch", "speed_lag_and_floor_seam",
    "cornering_speed_loss_and_servo_warm_up",
    "wheel_lag_and_wheel_diameter_mismatch", "yaw_acceleration_limit_and_marker_offset", "wheel_lag_and_tyre_warm_up",
)  # fmt: skip
"""Two effects of the library, and one beside one from outside; each for the vehicles that can have both."""


def everything(kinematics: Kinematics) -> tuple[str, ...]:
    """Return all that is hidden by default in vehicles of a kind: nothing, each effect, and some pairs."""
    known = catalogue(kinematics)
    return (NOTHING, *known, *(pair for pair in PAIRS if known.keys() >= set(pair.split(AND))))


def run_challenge(
    seeds: int,
    *,
    first_seed: int,
    specs: Sequence[str],
    repeats: int,
    jobs: int | None,
    json_file: str | None,
    resume: bool = False,
    cluster: ExecutorOptions | None = None,
    kinematics: Kinematics = "two_axle",
    campaigns: str | None = None,
) -> Scores:
    """Hold the trials with a progress bar, and write the scores if asked for.

    They are held in `jobs` processes, or on a `cluster`; the trials are the same but for their times.

    The file is written anew after each trial, so that an interruption loses those under way only; with `resume` the
    trials that it holds are not held again. Campaigns are kept in the folder `campaigns`, if it is named; those that
    it holds are diagnosed without being driven again.

    Raises
    ------
    FlagError
        If a number is out of range, a name unknown, or the folder of the campaigns cannot be made.
    FileError
        If the JSON file cannot be written or, to resume, read.
    LinkError
        If a cluster cannot be used.
    """
    if resume and json_file is None:
        raise FlagError("needs the file to go on with", where="--resume", remedy="add --json FILE")
    if seeds < 1 or repeats < 2:
        raise FlagError(
            "too few to score", where="--seeds, --repeats", value=f"{seeds}, {repeats}", limit="from 1, from 2"
        )
    if first_seed < 0:
        raise FlagError("is too small", where="--first-seed", value=first_seed, limit="at least 0")
    options = replace(cluster or ExecutorOptions(), jobs=jobs)
    for where, value, most in (("--seeds", seeds, _MOST_SEEDS), ("--first-seed", first_seed, 2**62)):
        if value > most:
            raise FlagError("is too large", where=where, value=value, limit=f"at most {most}")
    for spec in specs:
        try:
            recipes(spec, kinematics)
        except PlantError as error:
            raise FlagError(error.what, where="--only", value=error.value, limit=error.limit) from None
    file = None if json_file is None else Path(json_file)
    kind = TrialKind(repeats, kinematics, None if campaigns is None else campaigns_folder(campaigns))
    known = known_trials(file, kind) if resume and file is not None and file.exists() else {}
    # What ended with an error may have met a full disk: it is tried again.
    done = {one: trial for one, trial in known.items() if trial.verdict != _ERROR}
    wanted = [(s, n) for n in range(first_seed, first_seed + seeds) for s in specs or everything(kinematics)]
    missing = [one for one in wanted if one not in done]
    with open_executor(options) as executor:
        for trial in _held(missing, kind, executor):
            done[trial.spec, trial.seed] = trial
            if file is not None:
                write_trials(file, kind, list(done.values()))
    return score([done[one] for one in sorted(wanted)])


def hold_trial(spec: str, seed: int, kind: TrialKind) -> Trial:
    """Drive a campaign with one hidden plant, diagnose it, and only then unseal the truth.

    A bench or a diagnosis that ends with an error is the answer ``"ERROR"``, with the cause.
    """
    from agvbench.campaign import Campaign
    from agvbench.diagnosis import Diagnosis, Verdict, diagnose

    began = time.process_time()
    try:
        with driven_campaign(spec, seed, kind) as directory:
            began = time.process_time()
            found, error = diagnose(Campaign.open(directory)), ""
    # Hours of other trials must not be lost for one that has no answer, be it for an internal error.
    except Exception as failure:  # noqa: BLE001
        found, error = Diagnosis(Verdict.NOT_IDENTIFIABLE, str(failure)), cause_of(failure)
    seconds = time.process_time() - began
    trial = unsealed(spec, seed, sealed_truth(spec, seed, kind.kinematics), found, seconds, kind.kinematics)
    return replace(trial, verdict=_ERROR, error=error) if error else trial


def unsealed(
    spec: str, seed: int, truth: SealedTruth, found: Diagnosis, seconds: float, kinematics: Kinematics = "two_axle"
) -> Trial:
    """Return the trial: the answer beside the truth."""
    held = found.held_out.errors.get(_POSITION, {}) if found.held_out else {}
    named = tuple(effect.name for effect in found.effects)
    others = {other for effect in found.effects for other in effect.confounded_with}
    doubtful = {*named, *others} - set(truth.library_names)
    ask = truth.library_names and doubtful
    return Trial(
        spec,
        seed,
        truth.kind,
        tuple(effect.name for effect in truth.effects),
        truth.library_names,
        next((effect.covariates for effect in truth.effects if effect.covariates), ()),
        truth.absorbed,
        any(effect.random_phase for effect in truth.effects),
        {e.name: e.parameters for e in truth.effects if e.kind == "library"},
        str(found.verdict),
        named,
        tuple(sorted(others)),
        tuple(dependence.covariate for dependence in found.depends_on),
        {e.name: {k: (p.value, p.stderr) for k, p in e.parameters.items()} for e in found.effects},
        {name: value**2 for name, value in held.items()},
        found.held_out.worse_on if found.held_out else (),
        _indistinguishable(seed, truth, kinematics) if ask else (),
        seconds,
    )


def _indistinguishable(seed: int, truth: SealedTruth, kinematics: Kinematics) -> tuple[str, ...]:
    """Return the indistinguishable alternatives of every hidden effect of the library, each as if hidden alone."""
    alone = [effect.name for effect in truth.effects if effect.library_name]
    base = vehicle_of(seed, kinematics)
    return tuple(
        dict.fromkeys(
            r for name in alone for r in indistinguishable_effects(base, sealed_truth(name, seed, kinematics))
        )
    )


def _held(wanted: Sequence[tuple[str, int]], kind: TrialKind, executor: Executor) -> Iterator[Trial]:
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    tasks = (Task(one, hold_trial, (*one, kind)) for one in wanted)
    outcomes = executor.run(tasks, Trial)
    for outcome in track(outcomes, "blind trials", len(wanted), console=console, disable=not console.is_terminal):
        yield _trial_of(outcome, kind.kinematics)


def _trial_of(outcome: Outcome[tuple[str, int], Trial], kinematics: Kinematics) -> Trial:
    """Return a trial; one whose worker died, again and again, has the answer ``"ERROR"``.

    Raises
    ------
    RuntimeError
        If holding it failed otherwise: an error of the bench or the diagnosis is an answer, this is one of agvbench.
    """
    from agvbench.diagnosis import Diagnosis, Verdict

    if not isinstance(outcome, Failed):
        return outcome.result
    if outcome.was_raised:
        raise RuntimeError(outcome.cause)
    spec, seed = outcome.key
    unanswered = Diagnosis(Verdict.NOT_IDENTIFIABLE, outcome.cause)
    truth = sealed_truth(spec, seed, kinematics)
    trial = unsealed(spec, seed, truth, unanswered, math.nan, kinematics)
    return replace(trial, verdict=_ERROR, error=outcome.cause)


SCHEMA = 1


def write_trials(path: Path, kind: TrialKind, trials: Sequence[Trial]) -> None:
    """Write scores and trials, in the order of what was hidden; the file is replaced at once or not at all.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    ordered = sorted(trials, key=lambda trial: (trial.spec, trial.seed))
    scores = _without_empty(score(ordered).to_json(), "errors")
    # Files of two axles are older than those of others, and stay as they are.
    kinematics = {} if kind.kinematics == "two_axle" else {"kinematics": kind.kinematics}
    content: dict[str, Any] = {"schema": SCHEMA, **kinematics, "repeats": kind.repeats, **scores}
    content["each"] = [_without_empty(plain(asdict(trial)), "error") for trial in ordered]
    text = json.dumps(content, indent=1) + "\n"
    write_file("--json", path, lambda file: file.write_text(text, encoding="utf-8"))


def known_trials(path: Path, kind: TrialKind) -> dict[tuple[str, int], Trial]:
    """Return the trials that a file holds, by what was hidden and seed.

    A file that states no kinematics is one of two axles.

    Raises
    ------
    FileError
        If it cannot be read, is no such file, or was made with other repeats or other kinematics.
    """
    import msgspec

    try:
        content = read_json(path)
        found = msgspec.convert(_with_nan(content["each"]), list[Trial])
        was, driven = content["repeats"], content.get("kinematics", "two_axle")
    except (OSError, ValueError, KeyError, TypeError, msgspec.ValidationError) as error:
        raise FileError(
            "holds no challenge to go on with", where=path, value=str(error).splitlines()[0],
            remedy="leave out --resume to begin anew",
        ) from None  # fmt: skip
    if driven != kind.kinematics:
        raise FileError(
            "has trials with other kinematics", where=path, value=driven, limit=f"--kinematics {kind.kinematics}"
        )
    if was != kind.repeats:
        raise FileError("has trials with other repeats", where=path, value=was, limit=f"--repeats {kind.repeats}")
    return {(trial.spec, trial.seed): trial for trial in found}


def _without_empty(content: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in content.items() if name != key or value}


def _with_nan(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _with_nan(value) for key, value in content.items()}
    if isinstance(content, list):
        return [_with_nan(value) for value in content]
    return math.nan if content is None else content
