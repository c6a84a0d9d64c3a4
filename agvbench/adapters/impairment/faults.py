"""Faults: of the frames that a camera publishes, or of a vehicle and its line; and those of one adapter."""

from __future__ import annotations

import difflib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import cache
from typing import ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from agvbench.adapters.contract import run_seed
from agvbench.adapters.impairment.spec import SCHEME, Impairment
from agvbench.errors import LinkError, OneOf
from agvbench.registry import classes_by_file
from agvbench.types import Command, Frames

_FRAMES, _VEHICLE = "agvbench.adapters.impairment.frames", "agvbench.adapters.impairment.vehicle"


class Fault(ABC):
    """A fault of severity `value`; made once, begun anew for every run."""

    name: ClassVar[str]
    default: ClassVar[float] = 1.0
    """The value where none is given."""
    lowest: ClassVar[float] = 0.0
    highest: ClassVar[float] = 1.0

    def __init__(self, value: float | None = None) -> None:
        self.value = self.default if value is None else value
        if not self.lowest <= self.value <= self.highest:
            limit = f"{self.lowest:g} to {self.highest:g}"
            raise LinkError("fault value out of range", where=f"{SCHEME}:{self.name}", value=self.value, limit=limit)
        self.begin(np.random.default_rng(0))

    def begin(self, rng: np.random.Generator) -> None:
        """Begin a run, whose randomness is `rng`."""
        self.rng = rng


class FrameFault(Fault):
    """A fault of the frames that a camera publishes."""

    @abstractmethod
    def change(self, frames: Frames) -> Frames:
        """Return what becomes of a batch of frames, all of them captured since the fault began."""


@runtime_checkable
class SerialLine(Protocol):
    """A serial line to a vehicle, as far as faults go."""

    wire: Callable[[bytes], bytes]
    """What becomes of bytes on their way to the vehicle."""

    def press_reset(self) -> None:
        """Reset the microcontroller."""

    def pull(self) -> None:
        """Take the line away, for ever."""


class VehicleFault(Fault):
    """A fault that is injected before the vehicle gets a command."""

    needs_line: ClassVar[bool] = False

    def inject(self, line: SerialLine | None) -> None:
        """Do it; called before every command from when the fault begins. `line` is None where there is none."""

    def alter(self, command: Command, neutral: Command) -> Command:
        """Return what the vehicle is commanded in place of `command`; `neutral` is what moves nothing."""
        return command

    def release(self) -> None:
        """Release every thread that the fault holds; the adapter is closed."""


class LineFault(VehicleFault):
    """A fault of the bytes on their way to a vehicle with a serial line."""

    needs_line = True

    def inject(self, line: SerialLine | None) -> None:
        """Take over the wire."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        line.wire = self.carry

    @abstractmethod
    def carry(self, data: bytes) -> bytes:
        """Return what arrives of `data`."""


def frame_fault(impairment: Impairment) -> FrameFault:
    """Return the fault of frames that `impairment` names, or raise `LinkError`."""
    fault = _make(impairment, _FRAMES)
    assert isinstance(fault, FrameFault)  # noqa: S101  (for the type checker: its package has no others)
    return fault


def vehicle_fault(impairment: Impairment) -> VehicleFault:
    """Return the fault of a vehicle that `impairment` names, or raise `LinkError`."""
    fault = _make(impairment, _VEHICLE)
    assert isinstance(fault, VehicleFault)  # noqa: S101  (for the type checker: its package has no others)
    return fault


@cache
def _known(package: str) -> dict[str, type[Fault]]:
    return {fault.name: fault for fault in classes_by_file(package, Fault)}


def _make(impairment: Impairment, package: str) -> Fault:
    known = _known(package)
    if impairment.name in known:
        return known[impairment.name](impairment.value)
    close = difflib.get_close_matches(impairment.name, known, n=1)
    raise LinkError(
        "no such fault", where=SCHEME, value=repr(impairment.name), limit=OneOf(sorted(known)),
        remedy=f"did you mean '{close[0]}'?" if close else None,
    )  # fmt: skip


Kind = TypeVar("Kind", bound=Fault)


class Faults(Generic[Kind]):
    """Faults in the order in which they were asked for, begun anew for every run.

    Runs of a simulation are counted from 1; a real adapter's are all the first.
    """

    def __init__(self, impairments: list[Impairment], make: Callable[[Impairment], Kind], *, seed: int) -> None:
        self._each = [(impairment, make(impairment)) for impairment in impairments]
        self._seed, self._runs_begun = seed, 0

    def __iter__(self) -> Iterator[tuple[Impairment, Kind]]:
        """Every fault, beside when it holds."""
        return iter(self._each)

    @property
    def names(self) -> str:
        """What an identity says of them."""
        return " ".join(impairment.name for impairment, _ in self._each)

    @property
    def run(self) -> int:
        """Which run it is."""
        return max(1, self._runs_begun)

    def begin(self, run_key: str) -> None:
        """Begin a simulated run; all faults draw from one generator, which follows from the run's name."""
        self._runs_begun += 1
        rng = np.random.default_rng(run_seed(self._seed, run_key, "impairment", bits=128))
        for _, fault in self._each:
            fault.begin(rng)
