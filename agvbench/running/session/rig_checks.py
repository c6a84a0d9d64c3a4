"""The rig that a session asks for, and whether it can drive what it asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from agvbench.adapters import AdapterOptions, open_rig
from agvbench.adapters.contract import camera_options, named_values
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.identity import AgvIdentity, Identity
from agvbench.errors import FlagError, VehicleError
from agvbench.model import VehicleModel
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.rest_detection import LEAST_RATE_HZ
from agvbench.running.supervision.limits import DEFAULT_SAFETY
from agvbench.vehicle.channels import ROLES, Channel, Role

_OPTIONS = {"uncalibrated": "--vehicle", "calibrated": "--calibration", "corrected": "--corrected"}


def adapter_options(settings: BenchSettings, models: Mapping[str, VehicleModel]) -> AdapterOptions:
    """Return the options of a session's adapters."""
    nominal = models["uncalibrated"]
    return AdapterOptions(
        vehicle=settings.vehicle_name,
        plant=settings.plant,
        plant_options=named_values([settings.plant_option], "--plant-option"),
        seed=settings.seed,
        channels=nominal.channels,
        calibration_hash=models["calibrated"].calibration_hash if "calibrated" in models else "",
        camera=camera_options([settings.camera]),
    )


def _require_plant_in_unit(settings: BenchSettings, nominal: VehicleModel) -> None:
    """Refuse the plant that is simulated by default for a vehicle whose commands it does not understand."""
    unit = nominal.channels.drive.unit
    if settings.agv == "sim" and not settings.connect and settings.plant == BenchSettings.plant and unit != "us":
        raise FlagError(
            "the plant that is simulated by default takes pulses in µs", where="--plant", value=settings.plant,
            limit=f"the vehicle takes commands in {unit}",
            remedy="give a plant of this vehicle, such as --plant my_plant.py:make_plant "
            "(docs/how-to/bring-your-own-plant.md)",
        )  # fmt: skip


@contextmanager
def open_session_rig(
    settings: BenchSettings, models: Mapping[str, VehicleModel], listen: str | None = None
) -> Iterator[VehicleLink]:
    """Open the rig of a session while the context lasts, checked; others may join its bus at the endpoint `listen`.

    Raises
    ------
    AgvbenchError
        If an adapter cannot be opened, or `check_rig` refuses the rig.
    """
    if listen and settings.connect:
        raise FlagError(
            "a session that connects does not listen", where="--listen", value=listen,
            remedy=f"leave it out; agvbench watch --connect {settings.connect} sees this bench",
        )  # fmt: skip
    _require_plant_in_unit(settings, models["uncalibrated"])
    options = adapter_options(settings, models)
    with open_rig(
        agv=settings.agv,
        mocap=settings.mocap,
        plant=options.plant,
        plant_options=options.plant_options,
        camera=options.camera,
        seed=options.seed,
        connect=settings.connect or None,
        listen=[listen] if listen else [],
        bus_config=BusConfig.load(settings.bus_config) if settings.bus_config else None,
        lab=settings.lab,
        vehicle=options.vehicle,
        channels=options.channels,
        calibration_hash=options.calibration_hash,
    ) as link:
        check_rig(models, settings, link)
        yield link


def check_rig(models: Mapping[str, VehicleModel], settings: BenchSettings, link: VehicleLink) -> None:
    """Refuse what would go wrong later.

    Raises
    ------
    VehicleError
        If a model, by condition, would stop at another command than the vehicle does, or speaks in another unit.
    FlagError
        If an option is not for this rig.
    """
    check_commands(models, link.identity())
    _check_control_cycle(settings, link)
    _check_session(settings, link)
    _check_rate(link)


def check_commands(models: Mapping[str, VehicleModel], identity: AgvIdentity | Identity) -> None:
    """Raise `VehicleError` unless the models, by condition, command the vehicle in its unit, about its neutral."""
    for condition, model in models.items():
        _check_wheels(model, identity, _OPTIONS[condition])
        for role in ROLES:
            said, true = getattr(model.channels, role), getattr(identity.channels, role)
            for what, ours, theirs in _differences(said, true, role):
                raise VehicleError(
                    f"the vehicle {what} than its file says", where=model.name, value=ours, limit=theirs,
                    remedy=f"give the right file with {_OPTIONS[condition]}",
                )  # fmt: skip


def _check_wheels(model: VehicleModel, identity: AgvIdentity | Identity, option: str) -> None:
    said, true = model.channels.wheels, identity.channels.wheels
    if said != true:
        kind = "commands of the body"
        raise VehicleError(
            "the vehicle takes other wheel commands than its file says", where=model.name, value=str(said or kind),
            limit=str(true or kind), remedy=f"give the right file with {option}",
        )  # fmt: skip


def _differences(said: Channel, true: Channel, role: Role) -> Iterator[tuple[str, object, object]]:
    if said.unit != true.unit:
        yield "takes commands in another unit", said.unit, true.unit
    if said.neutral != true.neutral:
        yield "stands still at another command", said.neutral, true.neutral
    if said.low < true.low or said.high > true.high:
        yield f"takes {role} commands in a smaller range", said.range_text, true.range_text


def _check_control_cycle(settings: BenchSettings, link: VehicleLink) -> None:
    if settings.exchange > DEFAULT_SAFETY.control_cycle_s and not link.identity().lock_step:
        raise FlagError(
            "a vehicle in real time must be watched while it drives",
            where="--exchange",
            value=f"{settings.exchange:g} s",
            limit=f"{DEFAULT_SAFETY.control_cycle_s:g} s",
            remedy="leave it out",
        )


def _check_session(settings: BenchSettings, link: VehicleLink) -> None:
    if settings.session and link.identity().simulated:
        raise FlagError(
            "a simulated vehicle is never charged or re-mounted: its campaign is one session",
            where="--session",
            value=settings.session,
            remedy="leave it out",
        )


def _check_rate(link: VehicleLink) -> None:
    rate_hz = link.identity().mocap_rate_hz
    if rate_hz < LEAST_RATE_HZ:
        raise FlagError(
            "camera frame rate too low to detect standstill",
            where="--mocap",
            value=f"{rate_hz:g} Hz",
            limit=f"at least {LEAST_RATE_HZ:g} Hz",
            remedy="raise it in the camera's software, or of a simulated camera with --camera rate_hz=",
        )
