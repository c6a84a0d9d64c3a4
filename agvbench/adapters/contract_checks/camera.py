"""Checks of a mocap adapter: identity, options, start and close, and the frames of a second."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from agvbench.adapters.contract import AdapterOptions, MocapAdapter
from agvbench.adapters.contract_checks.result import CheckFailedError, CheckResult, call, run_check
from agvbench.adapters.contract_checks.stream import Stream, record_stream, require_frames, stream_checks
from agvbench.adapters.frame_recorder import FrameRecorder
from agvbench.adapters.registry import check_mocap, open_mocap
from agvbench.adapters.thread_failures import report_thread_failures
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.identity import MocapIdentity, decode_mocap_identity
from agvbench.errors import InputError

_UNKNOWN = "no_such_option"
_QUIET_S = 0.3
_CLOSE_AGAIN = "a second close must do nothing: closing a socket twice is allowed, joining a thread not started is not"


def check_camera(spec: str, options: AdapterOptions, *, watched_s: float = 1.0) -> Iterator[CheckResult]:
    """Check the mocap adapter `spec`; give one result after another.

    The adapter is opened three times, one after another. The last time it is started and watched for `watched_s` [s];
    a simulated one is shown a vehicle that drives straight ahead.

    Raises
    ------
    AgvbenchError
        If there is no such adapter, or it does not have the camera options that are given.
    """
    check_mocap(spec, options)
    yield _unknown_option(spec, options)
    opened = run_check("open", lambda: _opens(spec, options))
    yield opened
    if not opened.passed:
        return
    identified = run_check("identity", lambda: _with_camera(spec, options, _identity))
    yield identified
    yield run_check("close", lambda: _with_camera(spec, options, _close_at_once))
    yield run_check("close at start", lambda: _with_camera(spec, options, lambda c: _close_while_starting(c, options)))
    if identified.passed:
        yield from _started(spec, options, watched_s)


def _unknown_option(spec: str, options: AdapterOptions) -> CheckResult:
    def check() -> str:
        try:
            check_mocap(spec, replace(options, camera={**options.camera, _UNKNOWN: "1"}))
        except InputError:
            return "an unknown one is refused"
        raise CheckFailedError(
            f"--camera {_UNKNOWN}=1 is accepted", "let check call super().check, and declare option_names"
        )

    return run_check("options", check)


def _opens(spec: str, options: AdapterOptions) -> str:
    camera = call("open", lambda: open_mocap(spec, options))
    _close_quietly(camera)  # what is wrong with it is the result of another check
    return f"{type(camera).__name__} is opened"


def _with_camera(spec: str, options: AdapterOptions, check: Callable[[MocapAdapter], str]) -> str:
    """Return what `check` finds of a camera that is opened for it, and closed if the check has not."""
    camera = call("open", lambda: open_mocap(spec, options))
    try:
        found = check(camera)
    except BaseException:
        _close_quietly(camera)
        raise
    call("close again", camera.close)
    return found


def _close_quietly(camera: MocapAdapter) -> None:
    run_check("close", lambda: str(call("close", camera.close)))


def _identity(camera: MocapAdapter) -> str:
    identity: object = call("identity", camera.identity)
    if not isinstance(identity, MocapIdentity):
        raise CheckFailedError(
            f"identity returns {identity!r}", "return MocapIdentity(adapter=self.scheme, rate_hz=…, simulated=False)"
        )
    if decode_mocap_identity(encode(identity)) != identity:
        raise CheckFailedError(f"{identity} changes on the bus", "use texts, numbers and booleans only")
    if call("identity", camera.identity) != identity:
        raise CheckFailedError("identity changes from one call to the next", "return the same as long as it is open")
    kind = "simulated" if identity.simulated else "real"
    return f"{identity.adapter}, {kind}, nominal rate {identity.rate_hz:g} Hz; it crosses the bus unchanged"


def _close_at_once(camera: MocapAdapter) -> str:
    call("close", camera.close)
    try:
        call("close", camera.close)
    except Exception as error:
        raise CheckFailedError(f"a second close raises {type(error).__name__}: {error}", _CLOSE_AGAIN) from error
    return "before start, and again"


def _close_while_starting(camera: MocapAdapter, options: AdapterOptions) -> str:
    """Close the camera at once after `start`, while its thread begins to run."""
    recorder = FrameRecorder(options.clock)
    with report_thread_failures(camera, recorder.failed):
        call("start", lambda: camera.start(recorder))
        call("close", camera.close)
        _require_quiet(recorder, options)
    return "at once after start; nothing is reported after it"


def _require_quiet(recorder: FrameRecorder, options: AdapterOptions) -> None:
    recorder.take()
    options.clock.sleep(_QUIET_S)
    if error := recorder.take_error():
        raise error
    if count := sum(len(batch.frames) for batch in recorder.take()):
        raise CheckFailedError(
            f"{count} frames are reported after close returned",
            "join your thread in close, before you close its socket",
        )


def _started(spec: str, options: AdapterOptions, watched_s: float) -> Iterator[CheckResult]:
    camera, recorder = call("open", lambda: open_mocap(spec, options)), FrameRecorder(options.clock)
    with report_thread_failures(camera, recorder.failed):
        try:
            started = run_check("start", lambda: _start(camera, recorder))
            yield started
            if started.passed:
                yield from _stream(camera, recorder, options, watched_s)
        finally:
            closed = run_check("close under way", lambda: _close_running(camera, recorder, options))
        yield closed


def _stream(
    camera: MocapAdapter, recorder: FrameRecorder, options: AdapterOptions, watched_s: float
) -> Iterator[CheckResult]:
    """Record, and check what was recorded if frames arrived."""
    recorded: list[Stream] = []

    def arrive() -> str:
        recorded.append(record_stream(camera, recorder, options.clock, watched_s))
        return require_frames(recorded[0])

    yield (arrived := run_check("frames", arrive))
    if arrived.passed:
        for name, check in stream_checks(recorded[0]):
            yield run_check(name, check)


def _start(camera: MocapAdapter, recorder: FrameRecorder) -> str:
    call("start", lambda: camera.start(recorder))
    return "returns, and leaves the frames to another thread"


def _close_running(camera: MocapAdapter, recorder: FrameRecorder, options: AdapterOptions) -> str:
    call("close", camera.close)
    _require_quiet(recorder, options)
    call("close again", camera.close)
    return "nothing is reported after it"
