"""The process beside a bench that streams its campaign to a Rerun viewer: ``python -m … DIR [URL]``.

It reads the campaign's files, as they are renamed into place, and from standard input the states of a runner in real
time. The bench thus neither loads Rerun nor waits for the viewer. The end of standard input ends it. What ends it
earlier is one line on standard output.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from agvbench.bus.messages.runner_state import decode_runner_state
from agvbench.campaign.header import FILE_NAME
from agvbench.errors import AgvbenchError
from agvbench.plot.style import colour, condition_numbers
from agvbench.reporting.content import plain
from agvbench.reporting.viewer.blueprint import blueprint
from agvbench.reporting.viewer.campaign_follower import CampaignFollower
from agvbench.reporting.viewer.live_vehicle import LiveVehicle
from agvbench.reporting.viewer.process import viewer_command
from agvbench.reporting.viewer.run_entities import (
    Place,
    send_events,
    send_fault,
    send_floor,
    send_run,
    session_workspace,
)
from agvbench.types import CONDITIONS

if TYPE_CHECKING:
    import rerun as rr

_LOOK_S, _STATE_S = 1.0, 0.1
_START_LIMIT_S, _FLUSH_LIMIT_S = 30.0, 10.0
_END_LIMIT_S = 20.0
_NICE = 10


class ViewerGoneError(Exception):
    """The viewer did not come up, or is there no more."""


class StateInput:
    """Keeps the last state that arrives on `stream`: four bytes of length, least first, and a message."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._payload, self.ended = stream, b"", threading.Event()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while len(head := self._stream.read(4)) == 4:
            self._payload = self._stream.read(int.from_bytes(head, "little"))
        self.ended.set()

    def take(self) -> bytes:
        """Return the last state if it was not taken before, else nothing."""
        payload, self._payload = self._payload, b""
        return payload


class Viewer:
    """The viewer at `url`; without one, a new viewer on this machine, which stays open when the bench has ended."""

    def __init__(self, url: str) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.url = url or self._started()

    def _started(self) -> str:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        silent: dict[str, Any] = {
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.DEVNULL,
            "stderr": subprocess.DEVNULL,
        }
        self._process = subprocess.Popen(viewer_command(port), start_new_session=True, **silent)  # noqa: S603
        end_s = time.monotonic() + _START_LIMIT_S
        while time.monotonic() < end_s:
            self.check()
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    return f"rerun+http://127.0.0.1:{port}/proxy"
            time.sleep(0.1)
        raise ViewerGoneError(f"the Rerun viewer did not start within {_START_LIMIT_S:g} s")

    def check(self) -> None:
        """Raise `ViewerGoneError` if the viewer that was started has ended."""
        if self._process is None or (code := self._process.poll()) is None:
            return
        raise ViewerGoneError(
            f"the Rerun viewer has failed (exit code {code}); start rerun to see why"
            if code
            else "the Rerun viewer was closed"
        )


def stream(directory: Path, url: str, states: StateInput) -> None:
    """Stream until `states` end.

    Raises
    ------
    ViewerGoneError
        If the viewer is not there, or no more.
    """
    import rerun as rr

    viewer, follower = Viewer(url), CampaignFollower(directory)
    recording = rr.RecordingStream("agvbench", recording_id=plain(f"{directory.name}-live"), send_properties=False)
    layout = blueprint([Place(*map(plain, names)) for names in follower.planned_runs()], live=True)
    recording.connect_grpc(viewer.url, default_blueprint=layout)
    send_floor(recording, session_workspace(directory))
    vehicle, look_s = LiveVehicle(recording), 0.0
    while True:
        is_over = states.ended.wait(_STATE_S)  # looked at before the files: what was recorded by then is sent
        if payload := states.take():
            vehicle.show(decode_runner_state(payload), follower.plans())
        if is_over or time.monotonic() > look_s:
            viewer.check()
            _send_new(recording, follower)
            _flush(recording, viewer)
            look_s = time.monotonic() + _LOOK_S
        if is_over:
            return


def _send_new(recording: rr.RecordingStream, follower: CampaignFollower) -> None:
    """Send what was recorded since the last look."""
    numbers = condition_numbers(list(CONDITIONS))
    for run in follower.new_runs():
        if run.is_ok:
            send_run(recording, run, colour(numbers[run.condition]))
        else:
            send_fault(recording, run.started_s, "warn", f"{run.run_id}: {run.status}")
    send_events(recording, follower.new_events())


def _flush(recording: rr.RecordingStream, viewer: Viewer) -> None:
    """Wait until the viewer has what was sent; one that has ended is noticed meanwhile."""
    end_s = time.monotonic() + _FLUSH_LIMIT_S
    while True:
        try:
            recording.flush(timeout_sec=1.0)
        except (RuntimeError, ValueError) as error:
            viewer.check()
            if time.monotonic() > end_s:
                raise ViewerGoneError(f"the Rerun viewer does not answer ({str(error).splitlines()[0]})") from None
        else:
            return


def main(arguments: list[str]) -> int:
    """Stream the campaign that the arguments name; return the exit code."""
    os.nice(_NICE)  # the bench comes first
    directory, url = Path(arguments[0]), arguments[1] if len(arguments) > 1 else ""
    states = StateInput(sys.stdin.buffer)
    threading.Thread(target=_end_after, args=(states,), daemon=True).start()
    while not (directory / FILE_NAME).exists():
        if states.ended.wait(_STATE_S):
            return 0
    try:
        stream(directory, url, states)
    except (ViewerGoneError, AgvbenchError, OSError) as error:
        with suppress(OSError):  # a bench that was killed does not read it
            print(error, flush=True)
        return 1
    return 0


def _end_after(states: StateInput) -> None:
    """End this process in any case some time after the bench: a viewer that is gone may hold Rerun up for ever."""
    states.ended.wait()
    time.sleep(_END_LIMIT_S)
    _end(1)


def _end(code: int) -> None:
    """End without Python's own end: there, Rerun would wait for a viewer that is gone."""
    os._exit(code)


if __name__ == "__main__":
    try:
        _end(main(sys.argv[1:]))
    finally:
        _end(1)
