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
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from perf_diagnose import Part
from perf_measured import SPLITS, recordings
from rich.console import Console

from agvbench.campaign import CampaignHeader, import_recordings
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon, RecordedMotion, recording_of
from agvbench.diagnosis.findings.corrected_vehicle import corrected_vehicle
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.effects import Effect, effect_kinds
from agvbench.model import VehicleModel
from agvbench.types import Run
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
SLOW = {"warthog": {"steering_lag": {"time_constant_s": 0.8}, "mocap_latency": {"latency_s": 0.5}}}
"""Sizes for a vehicle whose poses come ten times a second."""
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
        names = {recording_of(run) for run in runs}
        noise = {n: RecordedMotion.of([r for r in runs if recording_of(r) == n]).filter.noise for n in names}
        return cls(header, runs, model, noise)

    def replayed(self, planted: Planted, seed: int) -> Part:
        """Return the recordings, driven again with what was planted."""
        rng = np.random.default_rng([0x4E91, seed])
        last = max(str(run.session) for run in self.runs)
        runs = []
        for run in self.runs:
            is_other = str(run.session) == last
            model = self.model.with_effects(*planted.effects())
            if is_other and planted.speed != 1.0:
                model = replace(model, drive=slower(model.drive, planted.speed))
            frames = run.frames
            t_s = np.maximum(frames.t_s - (planted.clock_s if is_other else 0.0), 0.0)
            start = (frames.x_m[0], frames.y_m[0], frames.heading_rad[0])
            poses = model.rollout([run.commands], [start], [t_s])[0]
            position, heading = self.noise[recording_of(run)]
            x, y, angle = (poses + rng.normal(size=poses.shape) * [position, position, heading]).T
            runs.append(replace(run, frames=replace(frames, x_m=x, y_m=y, heading_rad=angle)))
        return Part(self.header, runs)


def slower(drive: MonotoneTable, factor: float) -> MonotoneTable:
    return replace(drive, outputs=tuple(factor * value for value in drive.outputs))


def judged(found: Diagnosis, planted: Planted) -> tuple[int, int, str]:
    """Return how many names are right and wrong, and what was found in words."""
    true = {planted.effect[0]} if planted.effect else set()
    sessions = found.provenance["windows"]["sessions"]
    right = wrong = 0
    words = []
    for effect in found.effects:
        hit = bool(true & {effect.name, *effect.confounded_with})
        right, wrong = right + hit, wrong + (not hit)
        words.append(
            f"{effect.name} {', '.join(f'{p.value:.3g} ± {p.stderr:.1g}' for p in effect.parameters.values())}"
        )
    for name, session in sessions.items():
        for kind, size in (("clock_offset", planted.clock_s != 0.0), ("drive_level", planted.speed != 1.0)):
            if session.get(kind, {}).get("significant"):
                right, wrong = right + size, wrong + (not size)
                value, stderr = list(session[kind].values())[:2]
                words.append(f"{kind} of {name} {value:.3g} ± {stderr:.1g}")
    return right, wrong, "; ".join(words) or "nothing"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicles", nargs="*", default=list(SPLITS), metavar="VEHICLE")
    parser.add_argument("--replays", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--nothing", action="store_true", help="plant nothing: only controls")
    wanted = parser.parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 160)
    count = {"nothing planted": 0, "a name there": 0, "planted": 0, "found": 0, "wrong names": 0}
    for vehicle in wanted.vehicles:
        source = Source.of(vehicle)
        sessions = len({run.session for run in source.runs})
        for planted in (Planted(),) if wanted.nothing else (*PLANTED, *OWN.get(vehicle, ())):
            if (planted.clock_s or planted.speed != 1.0) and sessions < 2:
                continue
            if planted.effect and planted.effect[0] in SLOW.get(vehicle, {}):
                planted = Planted((planted.effect[0], SLOW[vehicle][planted.effect[0]]))  # noqa: PLW2901
            for seed in range(wanted.first_seed, wanted.first_seed + wanted.replays):
                found = diagnose(source.replayed(planted, seed), seed=seed)
                right, wrong, words = judged(found, planted)
                is_nothing = planted == Planted()
                count["nothing planted"] += is_nothing
                count["a name there"] += is_nothing and wrong > 0
                count["planted"] += not is_nothing
                count["found"] += right > 0
                count["wrong names"] += wrong if not is_nothing else 0
                console.print(f"{vehicle}, {planted}, seed {seed}: {found.verdict}: {words}", highlight=False)
    console.print(", ".join(f"{what}: {number}" for what, number in count.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
