"""Whether vehicle and camera answer, and understand what the vehicle file says."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing

from agvbench.adapters.camera_link import identify_here
from agvbench.adapters.registry import open_agv
from agvbench.bus.messages.identity import AgvIdentity, Identity, MocapIdentity
from agvbench.model import VehicleModel
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.configuration.vehicles import known_models
from agvbench.running.positioning.placers import choose_placer
from agvbench.running.session.rig_checks import adapter_options, check_commands, open_session_rig
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab


class AdaptersCheck(Check):
    """Opens the rig as a bench does, with the vehicle stopped; an adapter that is named alone is opened alone."""

    name = "adapters"

    def examine(self, lab: Lab) -> Finding:
        """Say which adapters answer, and in which unit."""
        settings = lab.settings
        models = known_models(settings)
        if lab.names_camera_alone and settings.connect:
            return Finding(FindingState.IDLE, "the camera on the bus is examined alone: see mocap")
        if lab.names_camera_alone:
            return Finding(FindingState.GOOD, _camera(identify_here(settings.mocap, adapter_options(settings, models))))
        if lab.names_vehicle_alone:
            return Finding(FindingState.GOOD, _vehicle_alone(settings, models))
        with open_session_rig(settings, models) as link:
            identity = link.identity()
        choose_placer(settings.place, simulated=identity.simulated)
        return Finding(FindingState.GOOD, f"{_vehicle(identity.agv)}; {_camera(identity.mocap)}")


def _vehicle_alone(settings: BenchSettings, models: Mapping[str, VehicleModel]) -> str:
    with closing(open_agv(settings.agv, adapter_options(settings, models))) as vehicle:
        vehicle.start(_Unheard())
        vehicle.stop()
        identity = vehicle.identity()
        check_commands(models, identity)
        return _vehicle(identity)


class _Unheard:
    """Takes what an adapter reports, and leaves it."""

    def truth(self, *_: object, **__: object) -> None: ...

    def event(self, *_: object, **__: object) -> None: ...

    def failed(self, *_: object, **__: object) -> None: ...


def _vehicle(identity: AgvIdentity | Identity) -> str:
    return f"{identity.vehicle} answers ({identity.firmware}), commands in {identity.channels}"


def _camera(identity: MocapIdentity) -> str:
    return f"{identity.adapter} is opened, nominal rate {identity.rate_hz:g} Hz"
