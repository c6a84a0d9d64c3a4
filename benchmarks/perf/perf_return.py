"""Repeats without an operator: the vehicle drives itself back to its start, again and again.

The default plant, the small front-steered one, and random ones with hidden effects, each with the nominal model, drive
``--returns 100`` consecutive repeats with ``--place auto``'s placer. A start is judged by the plant's own pose, not by
the camera: within 5 mm and 1°? Asked for are all of them, and a vehicle that never leaves the workspace.
``--plants 20 --first-seed 3000`` draws more plants; ``--only NAME …`` chooses what is hidden. Plant and camera are
called without a bus between them, which makes no difference but to the time that it takes; ``--bus`` puts it back.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from return_rig import Watched, rig

from agvbench.errors import AgvbenchError
from agvbench.model import VehicleModel, nominal_model
from agvbench.planning import Workspace, load_trajectory, plan
from agvbench.running.command_shares import Shares, held
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.running.execution.drive import drive
from agvbench.running.positioning.placers import Auto, Rig
from agvbench.running.quality import DEFAULT_LIMITS
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.simulator.hidden import sampled_spec
from agvbench.types import Commands, Pose, wrap_angle
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

FIRST_SEED = 3000
POSITION_M, HEADING_RAD = 0.005, math.radians(1.0)
ROOM = "circle:6.1"
TRAJECTORIES = ("1", "2", "5", "6", "7", "8")
SMALL = "agvbench.simulator:small_plant"
Job = tuple[Pose, Commands]


@dataclass
class Driven:
    """What one plant did: errors of its starts [m, rad], times [s], ways, and how far inside it stayed [m]."""

    name: str
    position_m: list[float] = field(default_factory=list)
    heading_rad: list[float] = field(default_factory=list)
    duration_s: list[float] = field(default_factory=list)
    attempts: list[int] = field(default_factory=list)
    outside: int = 0
    closest_m: float = math.inf
    failure: str = ""

    @property
    def within(self) -> int:
        """How many starts were good."""
        pairs = zip(self.position_m, self.heading_rad, strict=True)
        return sum(off_m <= POSITION_M and off_rad <= HEADING_RAD for off_m, off_rad in pairs)


def _jobs(model: VehicleModel, room: Workspace, *, small: bool) -> Iterator[Job]:
    """Return runs without end: the trajectories in turn, or short arcs for a car too fast for them."""
    if not small:
        plans = [plan(load_trajectory(name), model, workspace=room) for name in TRAJECTORIES]
        while True:
            yield from ((one.start, one.commands) for one in plans)
    rng, shares = np.random.default_rng(0), Shares.of_model(model)
    while True:
        start = Pose(*rng.uniform([-1.0, -1.0, -math.pi], [1.0, 1.0, math.pi]).tolist())
        share, front = rng.choice([-0.4, 0.4]), rng.uniform(-0.8, 0.8)
        yield start, held(model, [(1.2, shares.command(drive=float(share), front=float(front)))])


def _go(name: str, spec: str, seed: int, returns: int, *, bus: bool) -> Driven:
    small = spec == SMALL
    geometry = Geometry(front_axle_m=0.06, rear_axle_m=0.115)
    model = (
        nominal_model("small", geometry, Channels.alike("normalised"), rear_steered=False)
        if small
        else uncalibrated_vehicle()
    )
    room, driven = Workspace.parse(ROOM), Driven(name)
    Watched.spec = spec
    neutral = model.neutral
    with rig(seed, model, bus=bus) as link:
        supervisor = Supervisor(room, neutral)
        placer = Auto(Rig(link, model, room, supervisor, DEFAULT_LIMITS))
        jobs = _jobs(model, room, small=small)
        try:
            # The first is put there; the repeats that count drive back.
            for number in range(returns + 1):
                start, commands = next(jobs)
                Watched.latest.poses.clear()
                placing = placer.place(start, f"run{number}")
                if number and placing is not None:
                    _note(driven, start, room)
                    driven.duration_s.append(float(placing.duration_s))
                    driven.attempts.append(placing.attempts)
                drive(link, commands, neutral=neutral, start=start, run_key=None, supervisor=supervisor)
        except AgvbenchError as error:
            driven.failure = str(error)
    return driven


def _note(driven: Driven, start: Pose, room: Workspace) -> None:
    poses = np.array(Watched.latest.poses)
    x, y, heading = poses[-1].tolist()
    driven.position_m.append(math.hypot(x - start.x_m, y - start.y_m))
    driven.heading_rad.append(abs(wrap_angle(heading - start.heading_rad)))
    clearances = room.clearances(poses[:, :2])
    driven.closest_m = min(driven.closest_m, float(clearances.min()))
    driven.outside += bool((clearances < 0.0).any())


def _report(driven: Driven) -> None:
    if driven.position_m:
        mm, deg = np.array(driven.position_m) * 1e3, np.degrees(driven.heading_rad)
        print(
            f"{driven.name:44s} {driven.within:4d} of {len(mm):<4d} "
            f"{np.median(mm):5.2f} {mm.max():6.2f} {np.median(deg):6.2f} {deg.max():5.2f} "
            f"{statistics.median(driven.duration_s):7.1f} {max(driven.duration_s):6.1f} "
            f"{statistics.mean(driven.attempts):6.2f} {max(driven.attempts):3d} "
            f"{driven.outside:7d} {driven.closest_m:7.2f}  {driven.failure}",
            flush=True,
        )
    else:
        print(f"{driven.name:44s} {driven.failure}", flush=True)


def _plants(given: argparse.Namespace) -> Iterator[tuple[str, str, int]]:
    if given.only:
        for name in given.only:
            yield f"{name} {given.first_seed}", f"agvbench.simulator.hidden:{name}", given.first_seed
        return
    if not given.drawn_only:
        yield "default", "agvbench.simulator:make_plant", 0
        yield "small, front-steered", SMALL, 0
    for seed in range(given.first_seed, given.first_seed + given.plants):
        yield f"{sampled_spec(seed)} {seed}", "agvbench.simulator.hidden:make_plant", seed


def _sum(loops: Sequence[Driven], of: Callable[[Driven], int]) -> int:
    return sum(of(driven) for driven in loops)


def main() -> None:
    """Drive, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plants", type=int, default=4, help="drawn plants (default 4)")
    parser.add_argument("--returns", type=int, default=100, help="consecutive repeats of each (default 100)")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="hide these instead, each with the first seed")
    parser.add_argument("--drawn-only", action="store_true", help="leave out the plants that ship")
    parser.add_argument("--bus", action="store_true", help="drive over the bus")
    given = parser.parse_args()
    print(f"{'':44s} {'within':12s} {'mm':>5s} {'worst':>6s} {'deg':>6s} {'worst':>5s} "
          f"{'s':>7s} {'worst':>6s} {'ways':>6s} {'':3s} {'outside':>7s} {'inside m':>8s}")  # fmt: skip
    driven = []
    for name, spec, seed in _plants(given):
        driven.append(_go(name, spec, seed, given.returns, bus=given.bus))
        _report(driven[-1])
    asked, within = len(driven) * given.returns, _sum(driven, lambda one: one.within)
    outside = _sum(driven, lambda one: one.outside)
    print("\nwhat                               | ours             | asked | bound met?")
    print(f"starts within 5 mm and 1°          | {f'{within} of {asked}':16s} | all   | {_met(within == asked)}")
    print(f"returns that leave the workspace   | {outside:<16d} | 0     | {_met(not outside)}")


def _met(met: bool) -> str:
    return "yes" if met else "no"


if __name__ == "__main__":
    main()
