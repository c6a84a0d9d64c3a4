"""Whether the cameras answer, know the vehicle, and send frames that contain it."""

from __future__ import annotations

import math
import threading

from agvbench.adapters.camera_link import SeenCamera, listen_here, listen_on_bus
from agvbench.adapters.contract import AdapterOptions, camera_options
from agvbench.adapters.impairment.spec import unimpaired
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.emulated_camera import EMULATED
from agvbench.adapters.natnet.options import NatNetOptions
from agvbench.adapters.registry import parse_spec
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.clock import WallClock
from agvbench.running.configuration.settings import BenchSettings
from agvbench.workflows.doctor.finding import SIM, Check, Finding, FindingState, Lab

_WATCHED_S = 1.0
_UNSURE_S = 0.005
_LEAST_RATE_SHARE = 0.9
_SEVERITY = (FindingState.GOOD, FindingState.DOUBTFUL, FindingState.BAD)


class MocapCheck(Check):
    """Listens to every camera that is not simulated for a second; asks a NatNet server first."""

    name = "mocap"

    def examine(self, lab: Lab) -> Finding:
        """Say how many frames arrive, how many contain the vehicle, and the last pose."""
        settings = lab.settings
        if settings.connect:
            config = BusConfig.load(settings.bus_config) if settings.bus_config else None
            return _stream(listen_on_bus([settings.connect], settings.lab, settings.vehicle_name, config))
        if settings.mocap == SIM:
            return Finding(FindingState.IDLE, f"{SIM}: simulated", "give the cameras: --mocap natnet:HOST or FILE.py")
        asked = _asked(settings)
        if asked is not None and asked.state is FindingState.BAD:
            return asked
        options = AdapterOptions(vehicle=settings.vehicle_name, camera=camera_options([settings.camera]))
        return _worse(asked, _stream(listen_here(settings.mocap, options)))


def _worse(asked: Finding | None, heard: Finding) -> Finding:
    """Return both findings as one, with the worse state."""
    if asked is None:
        return heard
    state = max(asked.state, heard.state, key=_SEVERITY.index)
    return Finding(state, f"{asked.found}; {heard.found}", heard.remedy or asked.remedy)


def _stream(seen: SeenCamera) -> Finding:
    """Judge what arrived from a camera."""
    name, nominal_hz, summary = seen.identity.adapter, seen.identity.rate_hz, seen.summary
    if summary is None:
        return Finding(FindingState.IDLE, f"{name}: simulated, it sees nothing without a run")
    said = f"{name}: {summary}"
    if not summary.count:
        remedy = "start the camera's stream; see the address, the port, and the firewall of this machine"
        return Finding(FindingState.BAD, f"{said} arrived", remedy)
    if summary.pose is None:
        return Finding(FindingState.DOUBTFUL, said, "put the vehicle into view, and name its body")
    if summary.rate_hz < _LEAST_RATE_SHARE * nominal_hz:
        remedy = "look for lost frames, or let identity state the rate that the camera has"
        return Finding(FindingState.DOUBTFUL, f"{said} (nominal rate: {nominal_hz:g} Hz)", remedy)
    return Finding(FindingState.GOOD, said)


def _asked(settings: BenchSettings) -> Finding | None:
    """Return what a NatNet server says; None if the camera is another."""
    scheme, address = parse_spec(unimpaired(settings.mocap))
    if scheme != "natnet" or address == EMULATED:
        return None
    options = NatNetOptions.parse(address, camera_options([settings.camera]), settings.vehicle_name)
    seen: list[Seen] = []
    client = Client(options.connection, WallClock(), seen.append)
    try:
        client.start()
        threading.Event().wait(_WATCHED_S)
    finally:
        client.close()
    return _judged(client, seen, options.body)


def _judged(client: Client, seen: list[Seen], body: str) -> Finding:
    said = f"{client.info.application} streams NatNet {client.version} at {client.rate_hz:g} Hz"
    known = " ".join(sorted(client.names)) or "none"
    if not seen:
        return Finding(
            FindingState.BAD, f"{said}, but no frame came", "start streaming; see unicast, interface, firewall"
        )
    if body not in client.names and not (body.isascii() and body.isdigit()):
        remedy = "rename the rigid body in Motive, or say --camera body=NAME"
        return Finding(FindingState.BAD, f"{said}; no rigid body is called {body!r} (there are: {known})", remedy)
    bound_s = min(one.captured.uncertainty_s for one in seen)
    if client.counters.lost:
        said = f"{said}; {client.counters.lost} frames were lost in {_WATCHED_S:g} s"
        return Finding(FindingState.DOUBTFUL, said, "use a cable, not wireless; see what else the network carries")
    if bound_s > _UNSURE_S and math.isfinite(bound_s):
        said = f"{said}; capture times are known to ± {bound_s * 1e3:.1f} ms (limit: {_UNSURE_S * 1e3:g} ms)"
        return Finding(FindingState.DOUBTFUL, said, "put both machines on one switch")
    clock = f"to ± {bound_s * 1e3:.2f} ms" if math.isfinite(bound_s) else "by arrival only"
    return Finding(FindingState.GOOD, f"{said}; {known}; capture times known {clock}")
