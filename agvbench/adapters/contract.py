"""The adapter contract: what stands between the bus and a vehicle or a motion capture system, and its options.

An adapter knows nothing of the bus: a host (`agvbench.adapters.host`) calls its few methods, one at a time, and
gives it an object to report to. A new adapter is one file in ``agvbench/adapters/agv/`` or ``agvbench/adapters/mocap/``
with one subclass and its ``scheme``; it is found by name and inherits the tests.
"""

from __future__ import annotations

import difflib
import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, Self

import numpy as np

from agvbench.bus.clock import Clock, WallClock
from agvbench.bus.messages.command import CommandMessage
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity
from agvbench.bus.messages.request import Replay, Reset, Sampling
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import FlagError, LinkError, OneOf
from agvbench.types import Floats, Frames
from agvbench.vehicle.channels import Channels

DEFAULT_PLANT = "agvbench.simulator:make_plant"
SILENCE_LIMIT_S = 0.5
"""How long [s] a host lets a vehicle drive without a command, in real time."""


@dataclass(frozen=True)
class AdapterOptions:
    """What the user said about the rig; each adapter takes what concerns it.

    Parameters
    ----------
    vehicle
        The vehicle's name.
    plant, plant_options
        ``MODULE:FACTORY`` or ``FILE.py:FACTORY`` of a simulated vehicle, and keyword arguments of the factory by name
        (``--plant-option NAME=VALUE``); values of a command line are texts.
    seed
        Of the campaign: with a run's key it seeds all that is random in that run.
    channels
        What the vehicle understands, where the adapter cannot know: a plant does not say. By default µs about 1500.
    calibration_hash
        Of the vehicle model that the bench uses, for provenance.
    camera
        Options of the camera by name (``--camera NAME=VALUE``); values of a command line are texts. Which there are is
        the mocap adapter's `MocapAdapter.option_names`; those of a simulated camera are the parameters of
        `agvbench.simulator.Camera`.
    clock
        Real time, for whatever waits.
    """

    vehicle: str = "agv1"
    plant: str = DEFAULT_PLANT
    plant_options: Mapping[str, str | float] = field(default_factory=dict)
    seed: int = 0
    channels: Channels = field(default_factory=lambda: Channels.alike("us"))
    calibration_hash: str = ""
    camera: Mapping[str, str | float] = field(default_factory=dict)
    clock: Clock = field(default_factory=WallClock)


class AgvReports(Protocol):
    """What an AGV adapter can report to the bus. All methods may be called in any thread."""

    def truth(
        self, t_s: Floats, poses: Floats, *, end_s: float, acknowledged: int = 0, flags: int = TruthFlags.LAST
    ) -> None:
        """Show a simulated camera where the vehicle truly was: poses (n, 3) [m, m, rad] at `t_s` (n,) [s]."""

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Report an event: one word for programs and a line for people."""

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        """Stop the run under way with `error`: the runner raises it with its fields and its remedy."""


class MocapReports(Protocol):
    """What a mocap adapter can report to the bus. All methods may be called in any thread."""

    def frames(self, frames: Frames, *, clock: FrameClock, acknowledged: int = 0) -> None:
        """Publish frames whose times are in `clock`; `acknowledged` is the command they complete (lock step)."""

    def frame(
        self,
        t_s: float,
        x_m: float,
        y_m: float,
        heading_rad: float,
        *,
        clock: FrameClock,
        tracked: bool = True,
        frame: int = -1,
        mean_error_m: float = math.nan,
        received_s: float = math.nan,
        acknowledged: int = 0,
    ) -> None:
        """Publish one frame from plain numbers, see `agvbench.types.Frames`: the quick way in real time."""

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Report an event: one word for programs and a line for people."""

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        """Stop the run under way with `error`: the runner raises it with its fields and its remedy."""


class AgvAdapter(ABC):
    """Drives one vehicle.

    The host calls one method at a time. A method that fails raises an `agvbench.errors.AgvbenchError`, which the
    runner gets as its own.
    """

    scheme: ClassVar[str]
    """What users write before the colon: ``serial:/dev/ttyACM0`` is scheme ``serial``, address ``/dev/ttyACM0``."""
    watchdog_s: float = 0.25
    """How long [s] the vehicle drives on without a command: its own watchdog's limit, or `SILENCE_LIMIT_S` without one.

    A run in which commands were carried out further apart is rejected.
    """

    @classmethod
    @abstractmethod
    def open(cls, address: str, options: AdapterOptions) -> Self:
        """Connect to what is at `address` (``""`` if the user gave none)."""

    @abstractmethod
    def identity(self) -> AgvIdentity:
        """Return the identity; it does not change while the adapter is open."""

    def start(self, reports: AgvReports) -> None:  # noqa: B027  (many adapters have nothing to report)
        """Keep `reports` for later; called once, before anything else."""

    @abstractmethod
    def apply(self, message: CommandMessage) -> None:
        """Carry out a command, and return without waiting for its end.

        In lock step: let time pass until ``t_s + hold_s`` and show the camera the poses of that interval.
        """

    @abstractmethod
    def stop(self) -> None:
        """Go to neutral at once. Called on every way out: it must not depend on anything having worked before."""

    def reset(self, request: Reset) -> None:
        """Place a simulated vehicle; the default refuses."""
        raise LinkError("this vehicle cannot be placed by software", where=self.scheme, value=request.run_key)

    def replay(self, request: Replay) -> None:
        """Drive a simulated vehicle through a recorded run without frames; the default refuses."""
        raise LinkError("this vehicle cannot replay a run", where=self.scheme, value=request.reset.run_key)

    @abstractmethod
    def close(self) -> None:
        """Release what was opened; called once, after `stop`."""


class MocapAdapter(ABC):
    """Sees one vehicle."""

    scheme: ClassVar[str]
    """What users write before the colon: ``natnet:192.168.0.2`` is scheme ``natnet``, address ``192.168.0.2``."""
    option_names: ClassVar[tuple[str, ...]] = ()
    """Which names ``--camera NAME=VALUE`` may have, for `check`; their values are in ``options.camera``."""

    @classmethod
    @abstractmethod
    def open(cls, address: str, options: AdapterOptions) -> Self:
        """Connect to what is at `address` (``""`` if the user gave none)."""

    @classmethod
    def check(cls, address: str, options: AdapterOptions) -> None:
        """Raise what can be said of `address` and `options` without opening anything; called before `open`.

        The default refuses camera options that are not in `option_names`; an adapter that checks more calls it first.

        Raises
        ------
        FlagError
            If there is no such option.
        """
        for name in options.camera:
            if name not in cls.option_names:
                raise _no_such_option(name, cls.option_names, cls.scheme)

    @abstractmethod
    def identity(self) -> MocapIdentity:
        """Return the identity; it does not change while the adapter is open."""

    @abstractmethod
    def start(self, reports: MocapReports) -> None:
        """Keep `reports`; a real system publishes every frame from now on, in a thread of its own."""

    def reset(self, request: Reset) -> Sampling:
        """Begin a simulated run and say when frames are taken; the default refuses."""
        raise LinkError("this motion capture system is not simulated", where=self.scheme, value=request.run_key)

    def see(self, truth: Truth) -> None:
        """Look at a simulated vehicle; the default refuses."""
        raise LinkError("this motion capture system cannot see a simulated vehicle", where=self.scheme)

    @abstractmethod
    def close(self) -> None:
        """Release what was opened, and report nothing any more; before or just after `start`, and again, too."""


def _no_such_option(name: str, known: tuple[str, ...], scheme: str) -> FlagError:
    close = difflib.get_close_matches(name, known, n=1)
    remedy = f"did you mean '{close[0]}'?" if close else "leave it out, or declare it in option_names of the adapter"
    return FlagError(
        f"not an option of the camera {scheme}", where="--camera", value=repr(name),
        limit=OneOf(known) if known else "it has no options", remedy=remedy,
    )  # fmt: skip


NO_POSES = np.empty((0, 3))


def camera_options(pairs: Iterable[str]) -> dict[str, str]:
    """Return the camera's parameters by name, as `named_values` reads them."""
    return named_values(pairs, "--camera")


def named_values(pairs: Iterable[str], flag: str) -> dict[str, str]:
    """Return what an option `flag` gives by name.

    >>> named_values(["lost=0.01,rate_hz=240", "up=z"], "--camera")
    {'lost': '0.01', 'rate_hz': '240', 'up': 'z'}

    Raises
    ------
    FlagError
        If a pair has no ``=``.
    """
    options: dict[str, str] = {}
    for pair in filter(None, ",".join(pairs).split(",")):
        name, equals, value = pair.partition("=")
        if not (name and equals and value):
            raise FlagError("not a parameter and its value", where=flag, value=repr(pair), remedy="write NAME=VALUE")
        options[name] = value
    return options


def run_seed(seed: int, run_key: str, purpose: str, bits: int = 32) -> int:
    """Return a seed of `bits` bits for one purpose in one run.

    >>> run_seed(0, "steering-0001", "plant") == run_seed(0, "steering-0001", "plant")
    True
    >>> run_seed(0, "steering-0001", "plant") == run_seed(0, "steering-0001", "camera")
    False
    """
    text = f"agvbench\0{seed}\0{run_key}\0{purpose}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[: bits // 8], "little")
