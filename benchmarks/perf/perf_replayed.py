"""Whether a diagnosis of free driving finds what was planted, and nothing where nothing was: recordings, replayed.

Each recording of `perf_measured.py` is driven again by static maps fitted to it, with its commands, frame times, gaps
and noise; planted are an effect of the library, another clock or another level of the drive in the last session, or
nothing. Printed: for each the verdicts, names and sizes, and at the end how many names were right. Run with
``python benchmarks/perf/perf_replayed.py [VEHICLE ...] [--replays N] [--first-seed S] [--nothing]``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path

import numpy as np
from perf_diagnose import Part
from perf_measured import SPLITS, recordings
from rich.console import Console

from agvbench.campaign import CampaignHeader, import_recordings
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon, RecordedMotion, by_recording
from agvbench.diagnosis.findings.corrected_vehicle import corrected_vehicle
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.diagnosis.result import Estimate
from agvbench.effects import Effect, effect_kinds
from agvbench.model import VehicleModel
from agvbench.types import Commands, Floats, Run
from agvbench.vehicle.maps import MonotoneTable

MAX_WINDOWS = 300


@dataclass(frozen=True)
class Planted:
    """What a replay has that static maps lack: an effect, or a clock offset or a factor on the speed of one session."""

    effect: tuple[str, dict[str, float]] | None = None
    clock_s: float = 0.0
    speed: float = 1.0

    def effects(self) -> tuple[Effect, ...]:
        """Return the effects of the vehicle."""
        return () if self.effect is None else (effect_kinds()[self.effect[0]](**self.effect[1]),)

    def __str__(self) -> str:
        if self.effect:
            return f"{self.effect[0]} {', '.join(f'{value:g}' for value in self.effect[1].values())}"
        if self.clock_s:
            return f"clock of the last session {self.clock_s:g} s"
        return f"speed of the last session x {self.speed:g}" if self.speed != 1.0 else "nothing"


PLANTED = (
    Planted(),
    Planted(("steering_lag", {"time_constant_s": 0.15})),
    Planted(("speed_lag", {"accelerate_s": 0.3, "brake_s": 0.2})),
    Planted(("mocap_latency", {"latency_s": 0.08})),
    Planted(("lateral_slip", {"gradient": 0.3})),
    Planted(("marker_offset", {"forward_m": 0.03})),
    Planted(clock_s=0.12),
    Planted(speed=0.8),
)
OWN_SIZES: dict[str, dict[str, dict[str, float]]] = {
    "warthog": {
        "steering_lag": {"time_constant_s": 0.8},
        "mocap_latency": {"latency_s": 0.5},
        "lateral_slip": {"gradient": 2.0},
        "marker_offset": {"forward_m": 0.15},
    }
}
"""Sizes for a vehicle whose poses come ten times a second, that is five times as long, and that drives at 0.4 m/s."""
OWN = {"warthog": (Planted(("turning_resistance", {"friction_radps": 0.1, "integral_time_s": 3.0})),)}
"""What is planted in the recordings of one vehicle beside what is planted in all."""


@dataclass(frozen=True)
class Source:
    """The recordings of one vehicle, with static maps fitted to them and the noise of each recording's frames."""

    header: CampaignHeader
    runs: list[Run]
    model: VehicleModel
    noise: dict[str, np.ndarray]

    @classmethod
    def of(cls, vehicle: str) -> Source:
        """Return it for one of `SPLITS`."""
        with tempfile.TemporaryDirectory() as directory:
            campaign = import_recordings(vehicle, recordings(vehicle), Path(directory) / vehicle)
            header, runs = campaign.header, list(campaign)
        geometry = header.geometry
        windows = read_windows(runs, Horizon(), header.neutral, turns_on_the_spot=geometry.is_differential)
        fitted = static_maps(
            windows.select(np.arange(0, len(windows), 1 + len(windows) // MAX_WINDOWS)), runs, geometry, header.neutral
        )
        model = corrected_vehicle(header, geometry, fitted, fitted.predictor.maps, 0)
        noise = {name: RecordedMotion.of(cut).filter.noise for name, cut in by_recording(runs).items()}
        return cls(header, runs, model, noise)

    def replayed(self, planted: Planted, seed: int) -> Part:
        """Return the recordings, driven again with what was planted."""
        rng = np.random.default_rng([0x4E91, seed])
        last = max(str(run.session) for run in self.runs)
        runs: list[Run] = []
        for name, cut in by_recording(self.runs).items():
            is_other = str(cut[0].session) == last
            model = self.model.with_effects(*planted.effects())
            if is_other and planted.speed != 1.0:
                model = replace(model, drive=slower(model.drive, planted.speed))
            position, heading = self.noise[name]
            for run, poses in zip(cut, driven(model, cut, planted.clock_s * is_other), strict=True):
                x, y, angle = (poses + rng.normal(size=poses.shape) * [position, position, heading]).T
                runs.append(replace(run, frames=replace(run.frames, x_m=x, y_m=y, heading_rad=angle)))
        return Part(self.header, runs)


def driven(model: VehicleModel, cut: list[Run], clock_s: float) -> list[Floats]:
    """Return the poses (n, 3) of the frames of each run of a recording, which is driven without a stop.

    An import cuts recordings into runs. Its vehicle is in motion where one ends and the next begins.
    """
    began_s = [run.started_s - cut[0].started_s for run in cut]
    commands = [replace(run.commands, t_s=run.commands.t_s + t) for run, t in zip(cut, began_s, strict=True)]
    whole = Commands(*(np.concatenate([getattr(c, f.name) for c in commands]) for f in fields(Commands)))
    t_s = [np.maximum(run.frames.t_s + t - clock_s, 0.0) for run, t in zip(cut, began_s, strict=True)]
    frames = cut[0].frames
    start = (frames.x_m[0], frames.y_m[0], frames.heading_rad[0])
    poses = model.rollout([whole], [start], [np.concatenate(t_s)])[0]
    return np.split(poses, np.cumsum([len(t) for t in t_s])[:-1])


def slower(drive: MonotoneTable, factor: float) -> MonotoneTable:
    return replace(drive, outputs=tuple(factor * value for value in drive.outputs))


@dataclass(frozen=True)
class Judged:
    """One thing that was found: whether its name is ``right``, and its size (``sized``), and both in ``words``."""

    right: bool
    sized: bool
    words: str


def judged(found: Diagnosis, planted: Planted) -> list[Judged]:
    """Return what was found: effects, and offsets and levels of sessions."""
    return [*_judged_effects(found, planted), *_judged_sessions(found, planted)]


def _judged_effects(found: Diagnosis, planted: Planted) -> Iterator[Judged]:
    name, true = planted.effect or ("", {})
    for effect in found.effects:
        right, values = name in {effect.name, *effect.confounded_with}, list(effect.parameters.values())
        sized = right and "form" not in effect.evidence and all(map(is_sized, values, true.values()))
        sizes = ", ".join(f"{p.value:.3g} ± {p.stderr:.1g} {p.unit}" for p in values)
        yield Judged(right, sized, f"{effect.name} {sizes}")


def _judged_sessions(found: Diagnosis, planted: Planted) -> Iterator[Judged]:
    sessions = found.provenance["windows"]["sessions"]
    planted_as = {"clock_offset": (planted.clock_s, 0.0), "drive_level": (planted.speed, 1.0)}
    for (name, session), (kind, (true, null)) in product(sessions.items(), planted_as.items()):
        if not session.get(kind, {}).get("significant"):
            continue
        value, stderr = list(session[kind].values())[:2]
        right, size = true != null, relative_size(kind, true, is_other=name == max(sessions))
        sized = right and is_sized(Estimate(value, stderr, ""), size)
        yield Judged(right, sized, f"{kind} of {name} {value:.3g} ± {stderr:.1g}")


def relative_size(kind: str, size: float, *, is_other: bool) -> float:
    """Return the size beside the other sessions, which of two sessions may be the last one."""
    if is_other:
        return size
    return -size if kind == "clock_offset" else 1.0 / size


def is_sized(found: Estimate, true: float) -> bool:
    """Return whether an estimate is certain to half the size, and right to a fifth or to two standard errors."""
    return found.stderr <= 0.5 * abs(true) and abs(found.value - true) <= max(0.2 * abs(true), 2.0 * found.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicles", nargs="*", default=list(SPLITS), metavar="VEHICLE")
    parser.add_argument("--replays", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--nothing", action="store_true", help="plant nothing: only controls")
    wanted = parser.parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 160)
    count = {"nothing planted": 0, "a name there": 0, "planted": 0, "found": 0, "sized": 0, "wrong names": 0}
    for vehicle in wanted.vehicles:
        source = Source.of(vehicle)
        sessions = len({run.session for run in source.runs})
        for planted in (Planted(),) if wanted.nothing else (*PLANTED, *OWN.get(vehicle, ())):
            if (planted.clock_s or planted.speed != 1.0) and sessions < 2:
                continue
            if planted.effect and planted.effect[0] in OWN_SIZES.get(vehicle, {}):
                planted = Planted((planted.effect[0], OWN_SIZES[vehicle][planted.effect[0]]))  # noqa: PLW2901
            for seed in range(wanted.first_seed, wanted.first_seed + wanted.replays):
                found = diagnose(source.replayed(planted, seed), seed=seed)
                things, is_nothing = judged(found, planted), planted == Planted()
                wrong, sized = sum(not one.right for one in things), any(one.sized for one in things)
                count["nothing planted"] += is_nothing
                count["a name there"] += is_nothing and wrong > 0
                count["planted"] += not is_nothing
                count["found"] += any(one.right for one in things)
                count["sized"] += sized
                count["wrong names"] += 0 if is_nothing else wrong
                words = "; ".join(one.words for one in things) or "nothing"
                line = f"{vehicle}, {planted}, seed {seed}: {found.verdict}: {words}"
                console.print(f"{line}{'' if is_nothing or sized else ' (not sized)'}", highlight=False)
    console.print(", ".join(f"{what}: {number}" for what, number in count.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
