"""A NatNet server on loopback that streams one rigid body, for tests of what listens to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, TRACKED
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData

RATE_HZ = 120.0


@contextmanager
def natnet_server(body: str = "agv1") -> Iterator[str]:
    """Stream the body, tracked and at rest, while the context lasts; give the adapter's specification."""
    server, over = Emulator(Settings(rate_hz=RATE_HZ), [Model(1, body)]), threading.Event()
    pose = np.zeros(1, BODY)
    pose["id"], pose["flags"], pose["quaternion"], pose["position_m"] = 1, TRACKED, (0.0, 0.0, 0.0, 1.0), (1.0, 0, -2.0)
    frame = FrameOfData(0, pose, np.zeros(0, MARKER), 0.0, 0, 0, 0, 0)
    thread = threading.Thread(target=_stream, args=(server, frame, over))
    thread.start()
    try:
        host, port = server.address
        yield f"natnet:{host}:{port}"
    finally:
        over.set()
        thread.join()
        server.close()


def _stream(server: Emulator, frame: FrameOfData, over: threading.Event) -> None:
    number, began_s = 0, time.monotonic()
    while not over.wait(max(0.0, began_s + number / RATE_HZ - time.monotonic())):
        number += 1
        server.send(frame._replace(number=number, exposed_ticks=server.ticks()))
