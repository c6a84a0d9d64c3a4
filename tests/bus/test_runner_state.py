"""The state of a runner: nothing in it is out of range or larger than its limits."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from agvbench.bus.messages.codec import MAX_MESSAGE_BYTES, VERSION, encode
from agvbench.bus.messages.runner_state import (
    MAX_ENTRIES,
    MAX_LINE,
    MAX_NAME,
    Phase,
    RunnerState,
    RunProgress,
    RunResult,
    decode_runner_state,
)
from agvbench.errors import MessageError
from agvbench.types import Command, Pose


def state(**more: Any) -> RunnerState:
    return RunnerState(**{
        "sequence": 1, "source": 7, "campaign": "monday", "version": "1.0", "phase": Phase.DRIVING,
        "began_unix_s": 1.7e9, "elapsed_s": 1.0, **more,
    })  # fmt: skip


def progress(**more: Any) -> RunProgress:
    names = ("run_id", "experiment", "trajectory", "condition")
    numbers = {"number": 1, "of": 2, "repeat": 1, "attempt": 1, "t_s": 0.0, "duration_s": 1.0}
    return RunProgress(**{**dict.fromkeys(names, "x"), **numbers, **more})


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"elapsed_s": -1.0}, "times of a runner are out of range: 1700000000.0, -1.0 s"),
        ({"elapsed_s": math.nan}, "times of a runner"),
        ({"began_unix_s": math.inf}, "times of a runner"),
        ({"pose": Pose(0.0, math.nan, 0.0)}, "pose of a runner is not finite"),
        ({"command": Command(math.inf, 0.0, 0.0)}, "command of a runner is not finite"),
        ({"faults": ("x",) * (MAX_ENTRIES + 1)}, "too many faults of a runner: 9 .limit: at most 8"),
        ({"results": (RunResult("x", "ok"),) * (MAX_ENTRIES + 1)}, "too many results of a runner"),
    ],
)
def test_a_state_out_of_range_is_refused_by_sender_and_receiver(fields: dict[str, Any], why: str) -> None:
    with pytest.raises(MessageError, match=why):
        state(**fields)
    plain = msgspec.to_builtins(fields)
    sent = msgspec.msgpack.decode(encode(state()))[1] | plain
    with pytest.raises(MessageError):
        decode_runner_state(msgspec.msgpack.encode([VERSION, sent]))


def test_a_run_or_a_result_out_of_range_is_refused() -> None:
    with pytest.raises(MessageError, match=r"number of a run is out of range: 3 \(limit: at most 2\)"):
        progress(number=3)
    for fields in ({"t_s": math.nan}, {"duration_s": -1.0}, {"duration_s": math.inf}):
        with pytest.raises(MessageError, match="progress of a run is out of range"):
            progress(**fields)
    with pytest.raises(MessageError, match="result of a run is not finite"):
        RunResult("x", "ok", math.nan, 0.0)


def test_texts_are_cut_by_the_sender_and_refused_by_the_receiver() -> None:
    long = "x" * 100_000
    result = RunResult(long, long)
    sent = state(
        campaign=long, version=long, failure=long, faults=(long,) * MAX_ENTRIES, results=(result,) * MAX_ENTRIES,
        run=progress(run_id=long, trajectory=long),
    )  # fmt: skip
    payload = encode(sent)
    assert len(payload) < MAX_MESSAGE_BYTES // 50
    received = decode_runner_state(payload)
    assert received == sent
    assert received.run is not None
    assert {len(received.campaign), len(received.run.run_id), len(received.results[0].run_id)} == {MAX_NAME}
    assert {len(received.faults[0]), len(received.results[0].status), len(str(received.failure))} == {MAX_LINE}
    fields = msgspec.msgpack.decode(payload)[1]
    run = fields["run"] | {"run_id": long}
    for name, value in (("campaign", long), ("faults", [long]), ("failure", long), ("run", run)):
        with pytest.raises(MessageError, match="cannot be decoded"):
            decode_runner_state(msgspec.msgpack.encode([VERSION, fields | {name: value}]))


def test_what_is_no_character_is_replaced() -> None:
    assert decode_runner_state(encode(state(campaign="a\udcffb", faults=("c\udcff",)))).campaign == "a?b"


def test_an_unknown_phase_is_refused() -> None:
    fields = msgspec.msgpack.decode(encode(state()))[1] | {"phase": "flying"}
    with pytest.raises(MessageError, match="Invalid enum value 'flying'"):
        decode_runner_state(msgspec.msgpack.encode([VERSION, fields]))
