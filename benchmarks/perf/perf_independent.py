"""Diagnoses of campaigns that simulators of other authors wrote: what is found, what is named wrongly, what is left.

    python benchmarks/perf/perf_independent.py SIMULATOR.py --vehicles 401 402 --out DIR [--jobs 2]

The authors of the simulators in `benchmarks/independent` saw the description of a campaign directory and a list of
causes in words, not the code. Per vehicle: each cause of the library alone, six pairs, six causes at once at 0.6 of
their sizes, one cause inside beside one outside, each cause outside, each change with time, and nothing. Each answer is
a line of DIR/answers.jsonl; an interrupted round goes on where it ended.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import msgspec
import numpy as np
import pandas as pd

from agvbench.campaign import Campaign
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.errors import AgvbenchError

PAIRS, MIXED, MANY, MANY_SCALE = 6, 4, 6, 0.6
ALSO_TRUE: Mapping[str, frozenset[str]] = {
    "run_out": frozenset({"speed_lag"}),
    "battery_change": frozenset({"battery_droop"}),
    "slow_evening": frozenset({"battery_droop"}),
    "warm_up": frozenset({"steering_lag", "speed_lag"}),  # a lag that decays
    "steering_hysteresis": frozenset({"steering_by_travel"}),  # the same equation: a true alternative of a backlash
    "asymmetric_servo_speed": frozenset({"steering_rate_limit"}),
    "relaxation_length": frozenset({"steering_lag"}),
    "servo_ringing": frozenset({"steering_lag"}),
    "speed_overshoot": frozenset({"speed_lag"}),
    "one_sided_brake": frozenset({"speed_lag"}),  # it coasts
    "stick_at_start": frozenset({"speed_lag"}),
    "reversal_play": frozenset({"speed_lag"}),
    "tyre_saturation": frozenset({"speed_lag", "lateral_slip"}),  # soft tyres
    "inclined_floor": frozenset({"speed_lag"}),
    "tether": frozenset({"speed_lag"}),
    "dusty_floor": frozenset({"lateral_slip"}),
    "servo_deadband": frozenset({"steering_backlash"}),
    "slow_radio_frames": frozenset({"actuation_delay"}),
    "esc_soft_start": frozenset({"speed_lag"}),
    "coast_down": frozenset({"speed_lag"}),
    "esc_reverse_pause": frozenset({"speed_lag"}),
    "cogging_start": frozenset({"speed_lag"}),
    "battery_polarisation": frozenset({"speed_lag"}),  # it sags slowly under load
    "grip_limit": frozenset({"lateral_slip"}),
    "soft_tyres": frozenset({"lateral_slip"}),
    "battery_swap": frozenset({"battery_droop"}),
    "battery_knee": frozenset({"battery_droop"}),
    "cold_motor": frozenset({"battery_droop"}),
    "wet_floor_part": frozenset({"lateral_slip"}),
    "busy_radio_part": frozenset({"actuation_delay"}),
    "cold_servo": frozenset({"steering_lag"}),
    "linkage_wear": frozenset({"steering_backlash"}),
}
"""Effects and terms that describe a cause of another name, at least in part, and are no wrong name."""
WRONG_DISTANCES = frozenset({"wheelbase_error", "marker_offset"})
"""The axle distances in campaign.toml are wrong by a millimetre or two each, as those that a lab measures."""
ALWAYS_TRUE: Mapping[str, frozenset[str]] = {
    "state_space": frozenset({"speed_lag", "steering_lag"}),
    "rigid_body": frozenset({"speed_lag", "steering_lag", "axle_differential"}),
    "front_steered": frozenset({"speed_lag", "steering_lag", "axle_differential"}),
    "differential_wheels": frozenset({"speed_lag", "steering_lag", "wheel_lag", "actuation_delay"}),
}
"""Servos and motors of these simulators have a time constant of 1 to 5 ms, with and without a cause.

That of both wheels of a differential vehicle resembles a delay of 5 ms. The axles of `rigid_body` share a differential,
and those of some vehicles of `front_steered`.
"""
NAMES: Mapping[str, Mapping[str, str]] = {
    "differential_wheels": {"steering_rate_limit": "yaw_acceleration_limit", "motor_inertia": "wheel_lag"}
}
"""Causes that the library knows by another name on such a vehicle."""
ABSORBED: Mapping[str, frozenset[str]] = {
    "differential_wheels": frozenset({"drive_dead_band", "mocap_scale"}),
    "state_space": frozenset({"wheel_diameter_mismatch"}),
    "rigid_body": frozenset({"wheel_diameter_mismatch"}),
    "wheel_constraints": frozenset({"wheel_diameter_mismatch"}),
}
"""Causes that free maps absorb: they need no name.

A curvature b that is added to every path is a shift of both steering maps: tan δ_f by b·l_f and tan δ_r by −b·l_r leave
the lateral velocity as it is.
"""
LEAST_DELAY_S = 0.01
"""A delay that is shorter is true where every actuator has a time constant of 5 ms."""


@dataclass(frozen=True)
class Trial:
    """One campaign: its ``kind``, the ``vehicle``, the ``causes``, and the ``scale`` of their sizes."""

    kind: str
    vehicle: int
    causes: tuple[str, ...]
    scale: float = 1.0

    @property
    def name(self) -> str:
        """The name of the campaign."""
        return f"{self.vehicle}-{self.kind}-{'+'.join(self.causes) or 'nothing'}"


@dataclass(frozen=True)
class Answer:
    """What the diagnosis said of a trial; errors are of the end position [mm], ``floor`` is the repeatability."""

    trial: str
    kind: str
    verdict: str
    found: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    true_names: tuple[str, ...] = ()
    wrong_names: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def removed(self) -> float:
        """Share of the error beyond the repeatability that the model removes, in terms of squares."""
        before, after, floor = (self.errors.get(key, np.nan) ** 2 for key in ("before", "after", "floor"))
        return float(1.0 - max(after - floor, 0.0) / (before - floor)) if before > 4.0 * floor else float("nan")


def trials(simulator: Path, vehicle: int) -> Iterator[Trial]:
    """Yield the campaigns of a vehicle; the vehicle's number draws the combinations."""
    listed = run(simulator, "list")
    known: dict[str, str] = json.loads(listed)
    inside, outside, by_time = ([n for n, kind in known.items() if kind == k] for k in ("inside", "outside", "time"))
    rng = np.random.default_rng([zlib.crc32(simulator.name.encode()), vehicle])
    for cause in inside:
        yield Trial("single", vehicle, (cause,))
    for _ in range(PAIRS):
        yield Trial("pair", vehicle, tuple(rng.choice(inside, 2, replace=False).tolist()))
    yield Trial("six", vehicle, tuple(rng.choice(inside, MANY, replace=False).tolist()), MANY_SCALE)
    for _ in range(MIXED):
        yield Trial("mixed", vehicle, (str(rng.choice(inside)), str(rng.choice(outside))))
    for cause in outside:
        yield Trial("outside", vehicle, (cause,))
    for cause in by_time:
        yield Trial("time", vehicle, (cause,))
    yield Trial("nothing", vehicle, ())


def run(simulator: Path, *arguments: str) -> str:
    """Run the simulator; return what it prints."""
    done = subprocess.run([sys.executable, str(simulator), *arguments], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise SystemExit(f"{simulator}: {(done.stderr or done.stdout)[-500:]}")
    return done.stdout


def answered(simulator: Path, folder: Path, trial: Trial) -> Answer:
    """Write the campaign of one trial, diagnose it, and judge the answer; the campaign is deleted."""
    campaign = folder / trial.name
    shutil.rmtree(campaign, ignore_errors=True)
    options = [f"--vehicle={trial.vehicle}", f"--causes={','.join(trial.causes)}", f"--scale={trial.scale}", "--seed=1"]
    run(simulator, "write", str(campaign), *options)
    known: dict[str, str] = json.loads(run(simulator, "list"))
    began = time.process_time()
    try:
        found = diagnose(Campaign.open(campaign))
    except AgvbenchError as error:
        return Answer(trial.name, trial.kind, f"refused: {error}")
    except Exception as error:  # noqa: BLE001  (a crash is an answer, too)
        return Answer(trial.name, trial.kind, f"crash: {type(error).__name__}: {error}")
    shutil.rmtree(campaign)
    return judged(simulator.stem, trial, known, found, time.process_time() - began)


def judged(simulator: str, trial: Trial, known: Mapping[str, str], found: Diagnosis, seconds: float) -> Answer:
    """Hold a diagnosis against the causes."""
    named = {effect.name: {effect.name, *effect.confounded_with} for effect in found.effects}
    said = frozenset().union(*named.values()) if named else frozenset()
    also = (ALSO_TRUE.get(cause, frozenset()) for cause in trial.causes)
    absorbed, names = ABSORBED.get(simulator, frozenset()), NAMES.get(simulator, {})
    inside = [names.get(cause, cause) for cause in trial.causes if known[cause] == "inside" and cause not in absorbed]
    true = WRONG_DISTANCES.union(trial.causes, inside, ALWAYS_TRUE.get(simulator, ()), *also)
    if simulator in ALWAYS_TRUE and 0.0 < _delay_s(found) < LEAST_DELAY_S:
        true |= {"actuation_delay"}
    errors = dict(found.held_out.errors.get("end_position_mm", {})) if found.held_out is not None else {}
    return Answer(
        trial.name,
        trial.kind,
        str(found.verdict),
        tuple(cause for cause in inside if cause in said),
        tuple(cause for cause in inside if cause not in said),
        tuple(name for name, names in named.items() if names & true),
        tuple(name for name, names in named.items() if not names & true),
        tuple(one.covariate for one in found.depends_on),
        errors,
        seconds,
    )


def _delay_s(found: Diagnosis) -> float:
    """Return the longest delay of the actuators that a diagnosis states [s]; 0 if it states none."""
    delays = [effect for effect in found.effects if effect.name == "actuation_delay"]
    return max((value.value for effect in delays for value in effect.parameters.values()), default=0.0)


def line(answer: Answer) -> str:
    """Return one answer as a line."""
    error = " → ".join(f"{answer.errors.get(key, np.nan):.1f}" for key in ("before", "after"))
    return (
        f"{answer.trial}: {answer.verdict}; true {', '.join(answer.true_names) or '-'}; missed "
        f"{', '.join(answer.missed) or '-'}; wrong {', '.join(answer.wrong_names) or '-'}; "
        f"{', '.join(answer.depends_on[:2]) or '-'}; {error} mm ({answer.errors.get('floor', np.nan):.1f}); "
        f"{answer.seconds:.0f} s"
    )


def summary(answers: Sequence[Answer]) -> pd.DataFrame:
    """Return the figures of each kind of trial."""
    rows = {}
    for kind in dict.fromkeys(answer.kind for answer in answers):
        own = [answer for answer in answers if answer.kind == kind]
        found, missed = sum(len(a.found) for a in own), sum(len(a.missed) for a in own)
        names = sum(len(a.true_names) + len(a.wrong_names) for a in own)
        removed = [a.removed for a in own if np.isfinite(a.removed)]
        rows[kind] = {
            "trials": len(own),
            "found": f"{found} of {found + missed}",
            "names true": f"{sum(len(a.true_names) for a in own)} of {names}",
            "no wrong name": sum(not a.wrong_names for a in own),
            "UNKNOWN": sum(a.verdict == "UNKNOWN" for a in own),
            "time first": sum(a.depends_on[:1] in [("campaign_time_h",), ("session",)] for a in own),
            "ADEQUATE": sum(a.verdict == "ADEQUATE" for a in own),
            "removed, median": round(float(np.median(removed)), 3) if removed else np.nan,
            "refused or crashed": sum(a.verdict.startswith(("refused", "crash")) for a in own),
            "s, median": round(float(np.median([a.seconds for a in own]))),
        }
    return pd.DataFrame.from_dict(rows, orient="index")


def main() -> int:
    """Read the command line, run the trials that are missing, and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", type=Path)
    parser.add_argument("--vehicles", type=int, nargs="+", default=[401])
    parser.add_argument("--only", default="", help="trials with this in their names")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    written = arguments.out / "answers.jsonl"
    lines = written.read_text(encoding="utf-8").splitlines() if written.exists() else []
    answers = [msgspec.json.decode(one, type=Answer) for one in lines]
    every = [one for vehicle in arguments.vehicles for one in trials(arguments.simulator, vehicle)]
    known = {answer.trial for answer in answers}
    missing = [one for one in every if one.name not in known and arguments.only in one.name]
    with ProcessPoolExecutor(arguments.jobs) as pool, written.open("a", encoding="utf-8") as file:
        for answer in pool.map(partial(answered, arguments.simulator, arguments.out), missing):
            file.write(json.dumps(asdict(answer)) + "\n")
            file.flush()
            answers.append(answer)
            print(line(answer), flush=True)
    print(summary(answers).to_string())
    return 0


if __name__ == "__main__":
    sys.exit(main())
