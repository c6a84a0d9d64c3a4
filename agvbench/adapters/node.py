"""A node: the adapters of one vehicle that live in one process, and the true poses for cameras in another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from msgspec.structs import replace

from agvbench.adapters.agv_host import AgvHost
from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.frame_recorder import FrameRecorder
from agvbench.adapters.mocap_host import MocapHost
from agvbench.adapters.registry import open_agv, open_mocap
from agvbench.bus.clock import Clock
from agvbench.bus.counters import Sequence
from agvbench.bus.keys import Keys
from agvbench.bus.messages.codec import ENCODING, MAX_ROWS, encode
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import AdapterGoneError


@contextmanager
def host_adapters(
    session: Any,
    lab: str,
    options: AdapterOptions,
    *,
    agv: str | None,
    mocap: str | None,
    recorder: FrameRecorder | None = None,
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
    recorder
        Also receives what the camera reports.

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
            camera = MocapHost(session, keys, adapter, options.clock, listens_for_truth=agv is None, recorder=recorder)
            stack.callback(camera.close)
        if agv is not None:
            vehicle = open_agv(agv, options)
            show = TruthPublisher(session, keys, options.clock) if camera is None else camera.see
            host = AgvHost(session, keys, vehicle, options.clock, show)
            stack.callback(host.close)
        yield


_CAMERA_LIMIT_S = 5.0


class TruthPublisher:
    """Publishes true poses, in as many messages as they need; waits for a camera before the first."""

    def __init__(self, session: Any, keys: Keys, clock: Clock) -> None:
        import zenoh

        self._keys, self._clock, self._sequence = keys, clock, Sequence()
        self._publisher = session.declare_publisher(
            keys.truth,
            encoding=ENCODING,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def __call__(self, truth: Truth) -> None:
        """Publish `truth`.

        Raises
        ------
        AdapterGoneError
            If no camera listens.
        """
        if not self._publisher.matching_status.matching:
            self._wait_for_camera()
        for start in range(0, max(1, len(truth.t_s)), MAX_ROWS):
            rows = slice(start, start + MAX_ROWS)
            is_last = start + MAX_ROWS >= len(truth.t_s)
            part = replace(
                truth,
                sequence=self._sequence.take(),
                source=self._sequence.source,
                t_s=truth.t_s[rows],
                poses=truth.poses[rows],
                flags=truth.flags if is_last else TruthFlags.NONE,
            )
            self._publisher.put(encode(part))

    def _wait_for_camera(self) -> None:
        deadline_s = self._clock.now() + _CAMERA_LIMIT_S
        while not self._publisher.matching_status.matching:
            if self._clock.now() > deadline_s:
                raise AdapterGoneError(
                    "no simulated camera sees the vehicle",
                    where=self._keys.truth,
                    value=f"waited {_CAMERA_LIMIT_S:g} s",
                    remedy="start 'agvbench mocap sim' and connect it to this process",
                )
            self._clock.sleep(0.01)
