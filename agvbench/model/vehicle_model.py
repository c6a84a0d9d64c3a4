"""The vehicle model: static maps, kinematics and effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from numpy.typing import ArrayLike

from agvbench.effects import Effect
from agvbench.errors import VehicleError
from agvbench.model.priors import Prior
from agvbench.model.toml import naming_file, physics_digest, read_vehicle, write_vehicle
from agvbench.notebook_html import heading_html, table_html
from agvbench.types import Command, Commands, Floats
from agvbench.vehicle.channels import Channel, Channels, channels_of, quantity_of
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, StaticMap

_ROUNDING = 1e-9
# The tangent diverges at 90°, and no vehicle has such an angle.
_LARGEST_ANGLE_RAD = math.radians(89.0)


@dataclass(frozen=True)
class VehicleModel:
    """Static maps, kinematics and effects of one vehicle.

    Parameters
    ----------
    name
        The vehicle's name.
    geometry
        Positions of the axles.
    channels
        Unit, neutral command and range of each command channel.
    front, rear
        Command → axle angle [rad], counter-clockwise positive; `Fixed` for an axle that is not steered. The front map
        of a differential vehicle is command → yaw rate [rad/s], and its rear map is `Fixed`.
    drive
        Command → speed of the axles along their wheels [m/s].
    effects
        Further effects, each at most once; they act in the order of their stages.
    provenance
        Origin of the model; not part of the physics.
    priors
        Stated values of parameters of effects, each at most once: evidence for a diagnosis, not part of the physics.

    Raises
    ------
    VehicleError
        If a field is invalid.
    """

    name: str
    geometry: Geometry
    channels: Channels
    front: StaticMap
    rear: StaticMap
    drive: StaticMap
    effects: tuple[Effect, ...] = ()
    provenance: Mapping[str, str | float | int] = field(default_factory=dict, hash=False)
    priors: tuple[Prior, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "provenance", dict(self.provenance))
        object.__setattr__(self, "priors", tuple(self.priors))
        self._check_rear()
        self._check_angles()
        stated = [prior.name for prior in self.priors]
        for name in stated:
            if stated.count(name) > 1:
                raise VehicleError("a prior may be given once", where="priors", value=name)
        names = [effect.name for effect in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise VehicleError("an effect may be given once", where="effects", value=name)
        for effect in self.effects:
            self._check_kinematics(effect)
            if effect.needs_both_axles_driven and self.geometry.driven != "both" and not effect.is_null:
                raise VehicleError(
                    "an effect of two driven axles, but one is driven",
                    where="effects",
                    value=effect.name,
                    limit=f'driven = "{self.geometry.driven}"',
                    remedy="remove the effect, or correct geometry.driven",
                )

    def _check_kinematics(self, effect: Effect) -> None:
        is_differential = self.geometry.is_differential
        if effect.is_null or not (effect.needs_steered_axles if is_differential else effect.needs_differential):
            return
        of_other = (
            "steered axles, but the vehicle has none" if is_differential else "a differential vehicle, but this is none"
        )
        raise VehicleError(
            f"an effect of {of_other}",
            where="effects",
            value=effect.name,
            limit=f'kinematics = "{self.geometry.kinematics}"',
            remedy="remove the effect, or correct geometry.kinematics",
        )

    def _check_rear(self) -> None:
        if self.geometry.is_differential and not isinstance(self.rear, Fixed):
            raise VehicleError(
                "a differential vehicle steers no rear axle",
                where="maps.rear",
                value=type(self.rear).__name__,
                limit='kind = "fixed"',
                remedy="correct the map, or geometry.kinematics",
            )

    def _check_angles(self) -> None:
        for axle in ("rear",) if self.geometry.is_differential else ("front", "rear"):
            ends = [end for end in getattr(self, axle).output_range if math.isfinite(end)]
            for end in ends:
                if abs(end) > _LARGEST_ANGLE_RAD:
                    value, limit = f"{math.degrees(end):.1f}°", f"±{math.degrees(_LARGEST_ANGLE_RAD):.0f}°"
                    raise VehicleError("axle angle is too large", where=f"maps.{axle}", value=value, limit=limit)

    @property
    def neutral(self) -> Command:
        """The command at standstill with (about) straight axles."""
        return self.channels.neutral

    def axle_angles(self, front_command: ArrayLike, rear_command: ArrayLike) -> tuple[Floats, Floats]:
        """Return the steady-state angles of both axles [rad] for commands of any shape."""
        return self.front(front_command), self.rear(rear_command)

    def speed(self, drive_command: ArrayLike) -> Floats:
        """Return the steady-state speed of the axles [m/s] for commands of any shape."""
        return self.drive(drive_command)

    def command_for(self, front_rad: float, rear_rad: float, speed_mps: float) -> Command:
        """Return the command whose steady state has these axle angles [rad] and this speed of the axles [m/s].

        For a differential vehicle `front_rad` is the yaw rate [rad/s], and `rear_rad` is 0. If neutral already gives
        the value (standstill, an axle that is not steered), the command is neutral.

        Raises
        ------
        VehicleError
            If an angle or the speed is out of reach, with the limit.
        """
        return self.steering_for(front_rad, rear_rad)._replace(drive=self._inverse("drive", speed_mps))

    def steering_for(self, front_rad: float, rear_rad: float) -> Command:
        """Return the command with these axle angles [rad], as `command_for` does, and the drive at neutral.

        Raises
        ------
        VehicleError
            If an angle is out of reach, with the limit.
        """
        front, rear = self._inverse("front", front_rad), self._inverse("rear", rear_rad)
        return Command(drive=self.neutral.drive, front=front, rear=rear)

    def stop_after(self, command: Command) -> Command:
        """Return the command that stops the vehicle after `command`: the drive at neutral, the steering held.

        A differential vehicle steers with its drive: all is neutral.
        """
        if self.geometry.is_differential:
            return self.neutral
        return command._replace(drive=self.neutral.drive)

    def _inverse(self, role: str, output: float) -> float:
        static_map: StaticMap = getattr(self, role)
        channel: Channel = getattr(self.channels, role)
        quantity = quantity_of(role, self.geometry)
        what, scale, unit = quantity.name, quantity.scale, quantity.unit
        if float(static_map(channel.neutral)) == output:
            return channel.neutral
        try:
            command = float(static_map.inverse(output))
        except VehicleError as error:
            low, high = static_map.output_range
            inside = low <= output <= high
            raise VehicleError(
                error.what if inside else f"{what if what == quantity.channel else f'{role} {what}'} is out of reach",
                where=f"vehicle {self.name}",
                value=f"{scale * output:.4g} {unit}",
                limit=error.limit if inside else f"{scale * low:.4g} … {scale * high:.4g} {unit}",
                remedy=error.remedy,
            ) from None
        held = min(max(command, channel.low), channel.high)
        if not math.isclose(held, command, rel_tol=_ROUNDING, abs_tol=_ROUNDING):
            raise VehicleError(
                f"{role} {what} needs a command beyond its channel's range", where=f"vehicle {self.name}",
                value=f"{scale * output:.4g} {unit} at {command:.4g}", limit=channel.range_text,
            )  # fmt: skip
        return held

    def effect(self, name: str) -> Effect | None:
        """Return the effect called `name`, if this model has it."""
        return next((effect for effect in self.effects if effect.name == name), None)

    def with_effects(self, *effects: Effect) -> VehicleModel:
        """Return this model with `effects` added, each in place of one of the same name."""
        names = {effect.name for effect in effects}
        kept = tuple(effect for effect in self.effects if effect.name not in names)
        return replace(self, effects=kept + effects)

    @property
    def calibration_hash(self) -> str:
        """Sixteen hexadecimal digits that depend on the physics only, not on name or provenance."""
        return physics_digest(self)

    def _repr_html_(self) -> str:
        return model_html(self)

    @classmethod
    def load(cls, path: Path | str) -> VehicleModel:
        """Read a vehicle file; see `agvbench.model.toml.read_vehicle`.

        Raises
        ------
        FileError
            If the file is missing, unreadable or no TOML.
        VehicleError
            If its content is no vehicle of schema 1, naming file, key and what is wrong.
        """
        with naming_file(Path(path)):
            return cls(**read_vehicle(Path(path)))

    def save(self, path: Path | str) -> None:
        """Write a vehicle file that `load` reads back as an equal model.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        write_vehicle(self, Path(path))

    def rollout(
        self,
        commands: Sequence[Commands],
        initial: ArrayLike,
        t_s: Sequence[ArrayLike],
        started_h: Sequence[float] | None = None,
    ) -> list[Floats]:
        """Simulate a batch of runs; see `agvbench.model.rollout.rollout`."""
        from agvbench.model.rollout import rollout  # only here: numba takes a second to import

        return rollout(self, commands, initial, t_s, started_h)


def model_html(model: VehicleModel) -> str:
    """Return geometry, static maps with the range of their outputs, and effects with their parameters, as HTML."""
    geometry = model.geometry
    axles = f"rear axle {geometry.rear_axle_m:g} m behind it"
    if geometry.is_differential:
        axles = f"differential, axle {geometry.rear_axle_m:g} m behind the marker centroid"
    else:
        axles = f"front axle {geometry.front_axle_m:g} m ahead of the marker centroid, {axles}"
    line = f"{axles}; commands in {model.channels}"
    maps = [_map_row(model, role) for role in channels_of(geometry)]
    effects = [
        (effect.name, p.name, effect.values[p.name], p.unit) for effect in model.effects for p in effect.parameters()
    ]
    return (
        heading_html(model.name, line)
        + table_html("static maps", ["channel", "kind", "lowest", "highest", "unit"], maps)
        + table_html("effects", ["effect", "parameter", "value", "unit"], effects)
    )


def _map_row(model: VehicleModel, role: str) -> tuple[str, str, float, float, str]:
    static_map = getattr(model, role)
    quantity = quantity_of(role, model.geometry)
    low, high = (quantity.scale * end for end in static_map.output_range)
    return role, static_map.kind.replace("_", " "), low, high, quantity.unit
