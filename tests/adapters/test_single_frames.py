"""A camera that reports frame by frame, in plain numbers, is heard as one that reports columns."""

from __future__ import annotations

from typing import Any

import numpy as np

from agvbench.adapters.contract import AdapterOptions, MocapAdapter
from agvbench.adapters.mocap_host import MocapHost
from agvbench.bus.clock import WallClock
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import Keys
from agvbench.bus.messages.frames import FrameClock, FramesMessage
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.session import open_bus_session
from agvbench.types import Frames


class Camera(MocapAdapter):
    scheme = "still"

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> Camera:
        return cls()

    def identity(self) -> MocapIdentity:
        return MocapIdentity("still", 120.0, simulated=True)

    def start(self, reports: Any) -> None:
        self.reports = reports

    def reset(self, request: Reset) -> Sampling:
        return Sampling(120.0, 0.0)

    def close(self) -> None:
        pass


def test_one_frame_in_plain_numbers_is_the_same_message() -> None:
    camera, keys = Camera(), Keys("lab", "agv1")
    columns = Frames(*(np.array([v]) for v in (0.5, 1.0, -2.0, 3.0)), np.array([True]), np.array([9]), np.array([1e-4]), np.array([0.51]))  # fmt: skip  # noqa: E501
    with open_bus_session() as session:
        inbox = Inbox(session, keys)
        host = MocapHost(session, keys, camera, WallClock(), listens_for_truth=False)
        camera.reports.frames(columns, clock=FrameClock.ADAPTER, acknowledged=4)
        camera.reports.frame(
            0.5, 1.0, -2.0, 3.0, clock=FrameClock.ADAPTER, frame=9, mean_error_m=1e-4, received_s=0.51, acknowledged=4
        )
        camera.reports.frame(0.6, np.nan, np.nan, np.nan, clock=FrameClock.ADAPTER, tracked=False)
        first, second, lost = (inbox.receive() for _ in range(3))
        host.close()
        inbox.close()
    assert isinstance(first, FramesMessage)
    assert isinstance(second, FramesMessage)
    assert isinstance(lost, FramesMessage)
    assert (first.columns, first.acknowledged, first.clock) == (second.columns, second.acknowledged, second.clock)
    assert second.sequence == first.sequence + 1
    assert not lost.frames().tracked[0]
    assert np.isnan(lost.frames().mean_error_m[0])
