"""The rig: a vehicle, what sees it, and the link to both, ready for a runner."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from agvbench.adapters.contract import DEFAULT_PLANT, AdapterOptions
from agvbench.adapters.node import host_adapters
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.clock import Clock
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.identity import Identity
from agvbench.bus.session import bus_session
from agvbench.errors import LinkError
from agvbench.vehicle.channels import Channels


@contextmanager
def open_rig(
    agv: str = "sim",
    mocap: str = "sim",
    *,
    plant: str = DEFAULT_PLANT,
    plant_options: Mapping[str, str | float] | None = None,
    seed: int = 0,
    connect: str | Sequence[str] | None = None,
    listen: Sequence[str] = (),
    bus_config: BusConfig | None = None,
    lab: str = "lab",
    vehicle: str = "agv1",
    channels: Channels | None = None,
    calibration_hash: str = "",
    camera: Mapping[str, str | float] | None = None,
    clock: Clock | None = None,
    answer_limit_s: float = 60.0,
    discovery_limit_s: float = 5.0,
) -> Iterator[VehicleLink]:
    """Open a rig while the context lasts; on the way out, whatever the reason, the vehicle is stopped first.

    Parameters
    ----------
    agv, mocap
        Adapter specifications, ``SCHEME`` or ``SCHEME:ADDRESS``; not used with `connect`.
    plant, plant_options, seed, channels, calibration_hash, camera
        For the adapters (`AdapterOptions`). With `connect`, a simulator that runs with another seed is refused.
    connect
        Endpoints of adapters that run as their own processes, as ``"tcp/127.0.0.1:7447"``; None hosts them here, with
        nothing open to the network.
    listen
        Endpoints at which others may join the bus, such as ``agvbench watch``; each of them can drive the vehicle.
    bus_config
        Certificates and rules of a secured bus; endpoints of TLS and QUIC need one.
    lab, vehicle
        Names on the bus.
    clock
        What the run's time is measured in (`VehicleLink`).
    answer_limit_s, discovery_limit_s
        Limits in real time (`VehicleLink`).

    Raises
    ------
    AgvbenchError
        If an adapter cannot be opened, an endpoint not reached, or an adapter not found behind it.
    """
    endpoints = [connect] if isinstance(connect, str) else list(connect or ())
    with ExitStack() as stack:
        session: Any = stack.enter_context(
            bus_session(connect=endpoints, listen=listen, allow_remote=True, config=bus_config)
        )
        if not endpoints:
            options = AdapterOptions(
                vehicle=vehicle,
                plant=plant,
                plant_options=plant_options or {},
                seed=seed,
                channels=channels or Channels.alike("us"),
                calibration_hash=calibration_hash,
                camera=camera or {},
            )
            stack.enter_context(host_adapters(session, lab, options, agv=agv, mocap=mocap))
        link = VehicleLink(
            session,
            lab,
            vehicle,
            clock,
            calibration_hash=calibration_hash,
            answer_limit_s=answer_limit_s,
            discovery_limit_s=discovery_limit_s,
        )
        stack.enter_context(link)
        _check_seed(link.identity(), seed)
        yield link


def _check_seed(identity: Identity, seed: int) -> None:
    for role, extra in (("agv", identity.agv.extra), ("mocap", identity.mocap.extra)):
        if extra.get("seed", str(seed)) != str(seed):
            raise LinkError(
                f"the simulated {role} runs with another seed",
                where=f"{role} adapter",
                value=extra["seed"],
                limit=seed,
                remedy="give the bench and the simulator the same --seed",
            )
