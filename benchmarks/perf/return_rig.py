"""The rig of `perf_return`: a plant that says where it truly is, behind the bus or without one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

from msgspec.structs import replace

from agvbench.adapters import open_rig
from agvbench.adapters.agv.sim import SimAgv
from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.mocap.sim import SimMocap
from agvbench.bus.keys import Keys
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.identity import Identity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.messages.truth import Truth
from agvbench.model import VehicleModel
from agvbench.running.links import ContinuousLink, RunnerLink
from agvbench.simulator import load_plant
from agvbench.types import Command, Floats, Frames, Plant, Pose


class Watched:
    """A plant whose poses are kept: the truth that no camera says."""

    spec = "agvbench.simulator:make_plant"
    poses: list[tuple[float, float, float]]
    latest: Watched

    def __init__(self, plant: Plant) -> None:
        self._plant, self.poses = plant, []
        Watched.latest = self

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Place the plant."""
        self._plant.reset(pose, seed=seed)

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Advance the plant, and keep where it is."""
        self.poses.append(self._plant.advance(drive, front, rear, dt))
        return self.poses[-1]


def make_watched(seed: int) -> Watched:
    """Return the plant of `Watched.spec`; the rig finds this factory by its name."""
    return Watched(load_plant(Watched.spec)(seed))


@contextmanager
def rig(seed: int, model: VehicleModel, *, bus: bool) -> Iterator[RunnerLink]:
    """Open a rig with the plant of `Watched.spec`; its clock may begin anew."""
    if bus:
        plant = f"{__name__}:make_watched"
        with open_rig("sim", plant=plant, seed=seed, channels=model.channels) as link:
            yield ContinuousLink(link)
        return
    options = AdapterOptions(plant=Watched.spec, seed=seed, channels=model.channels)
    yield ContinuousLink(cast("VehicleLink", ShortCircuit(make_watched(seed), options)))


class ShortCircuit:
    """The simulated vehicle and camera of ``--agv sim --mocap sim``, called as the bus would."""

    def __init__(self, plant: Plant, options: AdapterOptions) -> None:
        self._agv, self._mocap = SimAgv(plant, options), SimMocap.open("", options)
        self._agv.start(cast("Any", self))
        self._mocap.start(cast("Any", self))
        self.keys, self._seen = Keys("lab", options.vehicle), [Frames.empty()]

    def identity(self) -> Identity:
        """Return the identities of vehicle and camera."""
        return Identity.of(self._agv.identity(), self._mocap.identity())

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place the vehicle."""
        request = Reset(run_key, pose, Sampling(1.0, 0.0), 0, 0)
        self._agv.reset(replace(request, sampling=self._mocap.reset(request)))

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Let the vehicle drive, and return what was seen."""
        return self._carry(CommandMessage(1, t_s, command, hold_s))

    def flush(self) -> Frames:
        """Return the frames that were late."""
        return self._carry(CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), 0.0, CommandFlags.FLUSH))

    def stop(self) -> None:
        """Do nothing: no time passes."""

    def _carry(self, message: CommandMessage) -> Frames:
        self._seen.clear()
        self._agv.apply(message)
        return Frames.concatenate(self._seen)

    def truth(self, t_s: Floats, poses: Floats, *, end_s: float, acknowledged: int = 0, flags: int = 1) -> None:
        """Show the camera where the vehicle is."""
        self._mocap.see(Truth(1, acknowledged, end_s, t_s, poses, flags, 1))

    def frames(self, frames: Frames, **_: object) -> None:
        """Take what the camera says."""
        self._seen.append(frames)
