"""The base class of effects, and the declaration of their parameters."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import FunctionType
from typing import Any, ClassVar, Self

from agvbench.errors import VehicleError
from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float, from_table, to_table


class Stage(StrEnum):
    """Stages of the chain from command to measured pose, in this order."""

    TRANSPORT = "transport"
    SERVO = "servo"
    WHEELS = "wheels"
    BODY = "body"
    FLOOR = "floor"
    CAMERA = "camera"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Parameters
    ----------
    name
        Field of the effect, key in TOML.
    unit
        SI unit, ``"–"`` for a ratio.
    null
        The value without influence (∞ for a limit).
    low, high
        Bounds of the value, in files and in fits.
    scale
        Typical size of the value: unit of the initial values and steps of a fit.
    is_discrete
        Whether predictions change in steps with it, as runs change sides: a fit leaves it at its start.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    scale: float
    is_discrete: bool = False

    @property
    def is_direction(self) -> bool:
        """Whether the value is an angle on the whole circle: its bounds are at least a turn apart."""
        return self.unit == "rad" and self.high - self.low >= math.tau


def parameter(*, unit: str, low: float, high: float, scale: float, null: float = 0.0, is_discrete: bool = False) -> Any:
    """Declare a field of an effect; its default is its null value. See `Parameter`."""
    metadata = {"unit": unit, "null": null, "low": low, "high": high, "scale": scale, "is_discrete": is_discrete}
    return dataclasses.field(default=null, metadata=metadata)


Hook = Callable[..., Any]

#: The hooks in the order of the chain, each with the stages that it belongs to.
HOOKS: Mapping[str, tuple[Stage, ...]] = {
    "arrive": (Stage.TRANSPORT,),
    "aim": (Stage.SERVO, Stage.WHEELS),
    "adopt": (Stage.WHEELS,),
    "steer": (Stage.WHEELS,),
    "drive": (Stage.WHEELS,),
    "move": (Stage.BODY,),
    "drift": (Stage.FLOOR,),
    "capture": (Stage.CAMERA,),
    "see": (Stage.CAMERA,),
}
#: Hooks that turn one time into another; all others change the state in place.
TIME_HOOKS = frozenset({"arrive", "capture"})

#: Entries of the state in which repeats of a run differ in more than their start pose, or which that pose rotates.
_OF_THE_ROOM = frozenset({"X", "Y", "HEADING", "X_RATE", "Y_RATE", "SEEN_X", "SEEN_Y", "HOURS", "LOGGED"})


def _reads(hook: Hook) -> set[str]:
    """Return the names that a hook uses, and the functions of its file that it calls."""
    names = set(hook.__code__.co_names)
    used = [getattr(one, "py_func", one) for one in map(hook.__globals__.get, names)]
    return names.union(*(_reads(one) for one in used if isinstance(one, FunctionType)))


@dataclass(frozen=True)
class Effect:
    """One physical cause that a vehicle model may have or lack.

    A concrete effect is a frozen dataclass in a file of this package; each field is a `parameter`, and an
    effect made without arguments does nothing. What it does is in its docstring as an equation, and in one
    or more hooks: static methods with the names below, taking `state` (see `agvbench.effects.state`) and then every
    parameter by name, in order. Hooks are compiled into the simulation, so they use arithmetic, ``math`` and the
    constants of their file only; they may be called as plain Python, too. A new file needs nothing else to be
    simulated, tested, listed, saved and fitted.

    Attributes
    ----------
    name
        The name in files and verdicts.
    stage
        The stage of the chain.
    relaxes
        The assumption of the thesis (sections 3.2, 7.3, 9.2) that the effect violates.
    reference
        Source of the equation.
    limits
        Limits of the equation, and effects that cannot be distinguished from it.
    remedy
        What to do in the workshop where it was found.
    longest_step_s
        Longest step of the simulation [s] while the effect is active. It is finite if a hook changes while the
        actuators are settled: with position, heading, time or distance. A step is integrated with four Gauss–Legendre
        nodes, so a quarter of the shortest period is enough.
    needs_both_axles_driven
        Whether the effect is about two driven axles, and no candidate where one is driven.
    needs_steered_axles
        Whether the effect is about axle angles, and no candidate for a differential vehicle.
    needs_differential
        Whether the effect is about a differential vehicle, and no candidate where axles are steered.
    arrive
        ``arrive(state, time_s, …) -> time_s``: time at which a command given at `time_s` takes effect; may change
        ``REAR_WAIT`` and ``DRIVE_WAIT``.
    aim
        Called when a command takes effect, which is in ``DRIVE_COMMAND`` …; may change the aims and the dynamics of the
        actuators: ``FRONT_AIM`` … ``BRAKE_LAG``, ``STEERING_INERTIA`` … ``BRAKING_LIMIT``, ``DRIVE_INERTIA``,
        ``DRIVE_BACKLASH``, ``RIGHT_RATE_RATIO``; and ``STEERING_LOAD`` … ``REAR_MOVED_TO``, which nothing else reads.
        An effect of the wheels may remember here what was commanded.
    adopt
        Called once where a simulation begins in motion, with the measured yaw rate in ``MEASURED_YAW_RATE`` and its
        share in a mean with the commands in ``MEASURED_WEIGHT``; may change what the effect remembers of earlier
        commands.
    steer
        Called at every time of evaluation, as all hooks below; may change ``FRONT`` and ``REAR``.
    drive
        May change ``FRONT_SPEED``, ``REAR_SPEED`` and ``DRAGGED``; knows the tangents of the angles.
    move
        May change ``FORWARD``, ``LEFT`` and ``YAW_RATE``.
    drift
        May change ``X_RATE``, ``Y_RATE`` and ``YAW_RATE``.
    capture
        ``capture(state, time_s, …) -> time_s``: true time of the pose with the time stamp `time_s`.
    see
        Called for every frame; may change ``SEEN_X``, ``SEEN_Y`` and ``SEEN_HEADING``, given ``X``, ``Y``, ``HEADING``,
        and ``SEEN_LAG``.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    relaxes: ClassVar[str]
    reference: ClassVar[str]
    limits: ClassVar[str]
    remedy: ClassVar[str] = ""

    longest_step_s: ClassVar[float] = math.inf
    needs_both_axles_driven: ClassVar[bool] = False
    needs_steered_axles: ClassVar[bool] = False
    needs_differential: ClassVar[bool] = False
    arrive: ClassVar[Hook | None] = None
    aim: ClassVar[Hook | None] = None
    adopt: ClassVar[Hook | None] = None
    steer: ClassVar[Hook | None] = None
    drive: ClassVar[Hook | None] = None
    move: ClassVar[Hook | None] = None
    drift: ClassVar[Hook | None] = None
    capture: ClassVar[Hook | None] = None
    see: ClassVar[Hook | None] = None

    @staticmethod
    def beside(outputs: Floats, at_neutral: float, *parameters: float) -> Floats:
        """Convert the outputs of a steering map (n,) [rad], fitted without this effect, for a model with it.

        Runs begin at neutral, where the map is `at_neutral`. A map that absorbed an effect may lie where the effect
        hides its values, and a fit from there would have a zero gradient. By default the outputs are unchanged.
        """
        del at_neutral, parameters
        return outputs

    def __post_init__(self) -> None:
        for p in self.parameters():
            coerce_float(self, p.name, allow_infinite=math.isinf(p.null))
            value = getattr(self, p.name)
            if value != p.null and not p.low <= value <= p.high:
                limit = f"{p.low:g} … {p.high:g} {p.unit}"
                raise VehicleError("is out of bounds", where=p.name, value=f"{value:g} {p.unit}", limit=limit)

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared parameters, in order."""
        return tuple(Parameter(name=f.name, **f.metadata) for f in dataclasses.fields(cls))

    @classmethod
    def hooks(cls) -> Mapping[str, Hook]:
        """Return the hooks of this effect, by name, in the order of the chain."""
        return {name: hook for name in HOOKS if (hook := getattr(cls, name)) is not None}

    @classmethod
    def acts_alike_on_repeats(cls) -> bool:
        """Whether the effect moves repeats alike, in the frame of their start pose.

        It does if no hook reads the place, the campaign time or a logged column.
        """
        return not any(_reads(hook) & _OF_THE_ROOM for hook in cls.hooks().values())

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters' values by name."""
        return to_table(self)

    @property
    def is_null(self) -> bool:
        """Whether every parameter has its null value."""
        return all(getattr(self, p.name) == p.null for p in self.parameters())

    def to_toml(self) -> dict[str, Any]:
        """Return this effect as a TOML table: its name and its parameters."""
        return {"name": self.name, **to_table(self)}

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, where: str = "effect") -> Self:
        """Build this effect from a TOML table; the key ``name`` may be there or not.

        Raises
        ------
        VehicleError
            If a parameter is unknown, no number or out of bounds.
        """
        return from_table(cls, {key: value for key, value in table.items() if key != "name"}, where=where)
