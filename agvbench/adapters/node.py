"""A node: the adapters of one vehicle that live in one process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from agvbench.adapters.agv_host import AgvHost
from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.mocap_host import MocapHost
from agvbench.adapters.registry import open_agv, open_mocap
from agvbench.adapters.truth_publisher import TruthPublisher
from agvbench.bus.keys import Keys


@contextmanager
def host_adapters(
    session: Any, lab: str, options: AdapterOptions, *, agv: str | None, mocap: str | None
) -> Iterator[None]:
    """Put adapters on the bus while the context lasts; on the way out the vehicle is stopped first.

    A simulated camera and a simulated vehicle in one node reach each other directly, in two nodes over the bus; the
    frames are the same.

    Parameters
    ----------
    session
        An open Zenoh session.
    lab
        The lab's name on the bus.
    options
        For both adapters.
    agv, mocap
        Adapter specifications (``"sim"``); None where another node hosts that adapter.

    Raises
    ------
    AgvbenchError
        If an adapter cannot be opened.
    """
    keys = Keys(lab, options.vehicle)
    with ExitStack() as stack:
        camera = None
        if mocap is not None:
            adapter = open_mocap(mocap, options)
            camera = MocapHost(session, keys, adapter, options.clock, listens_for_truth=agv is None)
            stack.callback(camera.close)
        if agv is not None:
            vehicle = open_agv(agv, options)
            show = TruthPublisher(session, keys, options.clock) if camera is None else camera.see
            host = AgvHost(session, keys, vehicle, options.clock, show)
            stack.callback(host.close)
        yield
