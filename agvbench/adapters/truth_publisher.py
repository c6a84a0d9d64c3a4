"""True poses onto the bus, for a camera in another process."""

from __future__ import annotations

from typing import Any

from agvbench.bus.clock import Clock
from agvbench.bus.keys import Keys
from agvbench.bus.sequence import Sequence
from agvbench.bus.truth_message import Truth, TruthFlags, encode_truth
from agvbench.bus.wire import MAX_ROWS
from agvbench.errors import AdapterGoneError

_CAMERA_LIMIT_S = 5.0


class TruthPublisher:
    """Publishes true poses, in as many messages as they need; waits for a camera before the first."""

    def __init__(self, session: Any, keys: Keys, clock: Clock) -> None:
        import zenoh

        self._keys, self._clock, self._sequence = keys, clock, Sequence()
        self._publisher = session.declare_publisher(
            keys.truth,
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
            part = truth._replace(
                sequence=self._sequence.take(),
                source=self._sequence.source,
                t_s=truth.t_s[rows],
                poses=truth.poses[rows],
                flags=truth.flags if is_last else TruthFlags.NONE,
            )
            self._publisher.put(encode_truth(part))

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
