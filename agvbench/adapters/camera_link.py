"""A camera alone, without a vehicle: opened here or found on the bus, and listened to."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from typing import NamedTuple

from agvbench.adapters.contract import AdapterOptions, MocapAdapter
from agvbench.adapters.frame_recorder import FrameRecorder, StreamSummary, listen
from agvbench.adapters.host import as_agvbench_error, checked_identity
from agvbench.adapters.registry import open_mocap
from agvbench.adapters.thread_failures import report_thread_failures
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.clock import Clock, WallClock
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import IDENTITY, MOCAP, Keys
from agvbench.bus.liveliness import Liveliness
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.frames import FramesMessage
from agvbench.bus.messages.identity import MocapIdentity, decode_mocap_identity
from agvbench.bus.queries import ask
from agvbench.bus.session import bus_session
from agvbench.errors import LinkError, MessageError

WATCHED_S, FIRST_FRAME_LIMIT_S = 1.0, 2.0
_DISCOVERY_LIMIT_S = 5.0


class SeenCamera(NamedTuple):
    """A camera's identity, and what arrived from it; None from a simulated one, which sees nothing by itself."""

    identity: MocapIdentity
    summary: StreamSummary | None


def identify_here(spec: str, options: AdapterOptions) -> MocapIdentity:
    """Open the camera `spec`, and return its identity.

    Raises
    ------
    AgvbenchError
        If one of the two fails.
    """
    with _opened(spec, options) as camera:
        return checked_identity(camera, MOCAP, MocapIdentity)


def listen_here(spec: str, options: AdapterOptions) -> SeenCamera:
    """Open the camera `spec`, listen to it for a second, and close it.

    Raises
    ------
    AgvbenchError
        If it cannot be opened or started, or reports an error.
    """
    recorder = FrameRecorder(options.clock)
    with _opened(spec, options) as camera, report_thread_failures(camera, recorder.failed):
        identity = checked_identity(camera, MOCAP, MocapIdentity)
        if identity.simulated:
            return SeenCamera(identity, None)
        camera.start(recorder)
        summary = listen(recorder, options.clock, WATCHED_S, FIRST_FRAME_LIMIT_S)
        if error := recorder.take_error():
            raise error
    return SeenCamera(identity, summary)


@contextmanager
def _opened(spec: str, options: AdapterOptions) -> Iterator[MocapAdapter]:
    """Give the camera, and close it; what its methods raise names it."""
    try:
        with closing(open_mocap(spec, options)) as camera:
            yield camera
    except Exception as error:
        raise as_agvbench_error(error, MOCAP) from error


def listen_on_bus(connect: Sequence[str], lab: str, vehicle: str, config: BusConfig | None = None) -> SeenCamera:
    """Find the camera of a vehicle on the bus, whether or not there is a vehicle, and listen to it for a second.

    Raises
    ------
    AgvbenchError
        If no endpoint or no camera is reached, or it reports an error.
    """
    keys, clock = Keys(lab, vehicle), WallClock()
    with bus_session(connect=list(connect), config=config) as session:
        inbox, liveliness = Inbox(session, keys), Liveliness(session, keys, clock)
        try:
            liveliness.wait_for(MOCAP, _DISCOVERY_LIMIT_S)
            payload = ask(session, keys.queryable(MOCAP, IDENTITY), b"", _DISCOVERY_LIMIT_S)
            identity = decode_mocap_identity(payload)
            return SeenCamera(identity, None if identity.simulated else _listen(inbox, clock))
        finally:
            liveliness.close()
            inbox.close()


def _listen(inbox: Inbox, clock: Clock) -> StreamSummary:
    """Return what arrives in a second; raise the error that the camera reports."""
    recorder = FrameRecorder(clock)
    threading.Thread(target=_receive, args=(inbox, recorder), name="agvbench-camera", daemon=True).start()
    summary = listen(recorder, clock, WATCHED_S, FIRST_FRAME_LIMIT_S)
    if error := recorder.take_error():
        raise error
    return summary


def _receive(inbox: Inbox, recorder: FrameRecorder) -> None:
    """Record what arrives until the inbox is closed."""
    while True:
        try:
            report = inbox.receive()
            if isinstance(report, FramesMessage):
                recorder.frames(report.frames(), clock=report.clock)
            elif isinstance(report, Event) and report.role == MOCAP and report.level == Level.ERROR:
                recorder.failed(report.as_error())
        except MessageError as error:
            recorder.failed(error)
        except LinkError:
            return
