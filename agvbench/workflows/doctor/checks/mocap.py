"""Whether the cameras answer, and know the vehicle."""

from __future__ import annotations

import math
import threading

from agvbench.adapters.contract import camera_options
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.options import NatNetOptions
from agvbench.adapters.registry import parse_spec
from agvbench.bus.clock import WallClock
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_WATCHED_S = 1.0
_UNSURE_S = 0.005


class MocapCheck(Check):
    """Connects to a NatNet server, and watches for a second."""

    name = "mocap"

    def examine(self, lab: Lab) -> Finding:
        """Say version, rate, bodies, and how well the two clocks are known to each other."""
        scheme, address = parse_spec(lab.settings.mocap)
        if scheme != "natnet" or address == "emulated":
            return Finding(
                FindingState.IDLE,
                f"{lab.settings.mocap}: nothing to connect to",
                "give the cameras: --mocap natnet:HOST",
            )
        camera = camera_options([lab.settings.camera])
        options = NatNetOptions.parse(address, camera, lab.settings.vehicle_name)
        seen: list[Seen] = []
        client = Client(options.connection, WallClock(), seen.append)
        try:
            client.start()
            threading.Event().wait(_WATCHED_S)
        finally:
            client.close()
        return self._judged(client, seen, options.body)

    def _judged(self, client: Client, seen: list[Seen], body: str) -> Finding:
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
