"""Messages: what is encoded is decoded again, and nothing else is ever decoded."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agvbench import errors
from agvbench.bus.messages.command import CommandMessage, decode_command, encode_command
from agvbench.bus.messages.event import Event, Level, decode_event, encode_event
from agvbench.bus.messages.frames import (
    FrameClock,
    FramesMessage,
    decode_frames,
    encode_frames,
    pack_columns,
    unpack_columns,
)
from agvbench.bus.messages.identity import (
    AgvIdentity,
    MocapIdentity,
    decode_agv_identity,
    decode_mocap_identity,
    encode_agv_identity,
    encode_mocap_identity,
)
from agvbench.bus.messages.request import (
    Replay,
    Reset,
    Sampling,
    decode_claim,
    decode_replay,
    decode_reset,
    decode_sampling,
    decode_time,
    encode_claim,
    encode_replay,
    encode_reset,
    encode_sampling,
    encode_time,
)
from agvbench.bus.messages.truth import Truth, decode_truth, encode_truth
from agvbench.bus.messages.wire import MAX_MESSAGE_BYTES, MAX_ROWS, VERSION
from agvbench.errors import LinkError, MessageError, PlanError
from agvbench.registry import own_classes
from agvbench.types import Command, Commands, Frames, Pose

finite = st.floats(allow_nan=False, allow_infinity=False)
anything = st.floats()
u32, u64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
text = st.text(st.characters(codec="utf-8"), max_size=40)
rate = st.floats(0.1, 1e6)
samplings = st.builds(Sampling, rate, finite)
resets = st.builds(Reset, text, st.builds(Pose, finite, finite, finite), samplings)


@st.composite
def frame_batches(draw: st.DrawFn) -> Frames:
    n = draw(st.integers(0, 20))
    column = arrays(np.float64, n, elements=anything)
    return Frames(
        draw(arrays(np.float64, n, elements=finite)),
        draw(column),
        draw(column),
        draw(column),
        draw(arrays(np.bool_, n)),
        draw(arrays(np.int64, n)),
        draw(column),
        draw(column),
    )


@st.composite
def truths(draw: st.DrawFn) -> Truth:
    n = draw(st.integers(0, 20))
    t_s, poses = draw(arrays(np.float64, n, elements=finite)), draw(arrays(np.float64, (n, 3), elements=finite))
    return Truth(draw(u64), draw(u64), draw(finite), t_s, poses, draw(st.integers(0, 7)), draw(u32))


@st.composite
def replays(draw: st.DrawFn) -> Replay:
    t_s = np.array(sorted(draw(st.sets(st.integers(-1000, 1000), max_size=20))), np.float64)
    columns = [draw(arrays(np.float64, len(t_s), elements=finite)) for _ in range(3)]
    return Replay(draw(resets), Commands(t_s, *columns), draw(finite))


commands = st.builds(
    CommandMessage,
    u64,
    finite,
    st.builds(Command, finite, finite, finite),
    st.floats(0.0, 3600.0),
    st.integers(0, 7),
    u32,
)
frame_messages = st.builds(
    FramesMessage,
    u64,
    frame_batches().map(pack_columns),
    u64,
    st.sampled_from(FrameClock),
    finite,
    st.integers(0, 1),
    u32,
)
details = (st.none() | text,) * 4
events = st.builds(Event, u64, text, st.sampled_from(Level), text, text, u64, finite, u32, *details)
agv_identities = st.builds(
    AgvIdentity,
    *(text,) * 4,
    st.sampled_from(["us", "normalised"]),
    finite,
    st.booleans(),
    st.booleans(),
    st.dictionaries(text, text, max_size=4),
)
mocap_identities = st.builds(MocapIdentity, text, rate, st.booleans(), st.dictionaries(text, text, max_size=4))

CODECS: dict[str, tuple[Any, Callable[[Any], bytes], Callable[[bytes], Any]]] = {
    "command": (commands, encode_command, decode_command),
    "frames": (frame_messages, encode_frames, decode_frames),
    "event": (events, encode_event, decode_event),
    "agv_identity": (agv_identities, encode_agv_identity, decode_agv_identity),
    "mocap_identity": (mocap_identities, encode_mocap_identity, decode_mocap_identity),
    "reset": (resets, encode_reset, decode_reset),
    "sampling": (samplings, encode_sampling, decode_sampling),
    "replay": (replays(), encode_replay, decode_replay),
    "time": (finite, encode_time, decode_time),
    "claim": (u32, encode_claim, decode_claim),
    "truth": (truths(), encode_truth, decode_truth),
}
few = settings(max_examples=40, deadline=None)
every_codec = pytest.mark.parametrize("codec", CODECS.values(), ids=list(CODECS))


def same(left: Any, right: Any) -> bool:
    """Compare messages field by field; arrays bit by bit, so that NaN equals NaN."""
    if isinstance(left, np.ndarray):
        return left.shape == right.shape and left.astype(right.dtype).tobytes() == np.ascontiguousarray(right).tobytes()
    if hasattr(left, "__dataclass_fields__"):
        return all(same(getattr(left, f.name), getattr(right, f.name)) for f in fields(left))
    if isinstance(left, tuple):
        return len(left) == len(right) and all(map(same, left, right))
    return bool(left == right) or (isinstance(left, float) and math.isnan(left) and math.isnan(right))


@every_codec
@few
@given(data=st.data())
def test_what_is_encoded_is_decoded(codec: Any, data: st.DataObject) -> None:
    strategy, encode, decode = codec
    message = data.draw(strategy)
    assert same(decode(encode(message)), message)


@few
@given(st.lists(frame_batches(), max_size=4))
def test_columns_of_many_messages_are_joined_bit_by_bit(batches: list[Frames]) -> None:
    assert same(unpack_columns([pack_columns(frames) for frames in batches]), Frames.concatenate(batches))


@few
@given(frame_batches(), st.integers(0, 7), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_frames_whose_numbers_cannot_be_are_refused(frames: Frames, which: int, time_s: float) -> None:
    if len(frames):
        row = which % len(frames)
        rows = bytearray(pack_columns(frames))
        rows[8 * row : 8 * row + 8] = np.float64(time_s).tobytes()
        with pytest.raises(MessageError, match="finite capture time"):
            unpack_columns([bytes(rows)])
        rows = bytearray(pack_columns(frames))
        rows[56 * len(frames) + row] = 2 + which
        with pytest.raises(MessageError, match="tracked is neither 0 nor 1"):
            unpack_columns([bytes(rows)])


@every_codec
@few
@given(data=st.data())
def test_cut_or_lengthened_messages_are_refused(codec: Any, data: st.DataObject) -> None:
    strategy, encode, decode = codec
    payload = encode(data.draw(strategy))
    cut = data.draw(st.integers(0, len(payload) - 1))
    with pytest.raises(MessageError):
        decode(payload[:cut])
    with pytest.raises(MessageError):
        decode(payload + data.draw(st.binary(min_size=1, max_size=9)))


@every_codec
@few
@given(data=st.data())
def test_a_damaged_message_is_refused_or_well_formed(codec: Any, data: st.DataObject) -> None:
    strategy, encode, decode = codec
    payload = bytearray(encode(data.draw(strategy)))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        message = decode(bytes(payload))
    except MessageError:
        return
    assert same(decode(encode(message)), message)


@every_codec
@few
@given(payload=st.binary(max_size=200))
def test_noise_is_refused(codec: Any, payload: bytes) -> None:
    with pytest.raises(MessageError):
        codec[2](payload)


@every_codec
@few
@given(payload=st.binary(max_size=200), count=u32, flags=st.integers(0, 65535))
def test_noise_behind_a_good_beginning_raises_nothing_else(codec: Any, payload: bytes, count: int, flags: int) -> None:
    _, encode, decode = codec
    kind = encode(_one(codec))[5:6]
    head = b"AGVB" + bytes([VERSION]) + kind + flags.to_bytes(2, "little") + b"\0\0\0\0" + count.to_bytes(4, "little")
    with suppress(MessageError):
        decode(head + payload)


def _one(codec: Any) -> Any:
    name = next(name for name, entry in CODECS.items() if entry is codec)
    pose = Pose(0.0, 0.0, 0.0)
    reset = Reset("run", pose, Sampling(120.0, 0.0))
    none = np.empty(0)
    return {
        "command": CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), 0.1),
        "frames": FramesMessage(1, pack_columns(Frames.empty())),
        "event": Event(1, "agv", Level.INFO, "kind", "text"),
        "agv_identity": AgvIdentity("a", "b", "c", "d", "us", 1500.0, True, True),
        "mocap_identity": MocapIdentity("a", 120.0, True),
        "reset": reset,
        "sampling": Sampling(120.0, 0.0),
        "replay": Replay(reset, Commands(none, none, none, none), 0.0),
        "time": 0.0,
        "claim": 7,
        "truth": Truth(1, 1, 0.0, none, np.empty((0, 3))),
    }[name]


def test_an_error_arrives_with_all_its_fields() -> None:
    sent = PlanError("radius is too small", where="plan", value="0.2 m", limit="0.3 m", remedy="widen the turn")
    error = decode_event(encode_event(Event.of_error(sent, "agv"))).as_error()
    assert type(error) is PlanError
    assert (error.what, error.where, error.value, error.limit, error.remedy) == (
        "radius is too small", "agv adapter: plan", "0.2 m", "0.3 m", "widen the turn",
    )  # fmt: skip
    bare = decode_event(encode_event(Event.of_error(LinkError("gone"), "agv"))).as_error()
    assert (str(bare), bare.remedy) == ("agv adapter: gone", None)


@pytest.mark.parametrize("kind", own_classes(errors, errors.AgvbenchError))
def test_every_class_of_error_arrives(kind: type[errors.AgvbenchError]) -> None:
    event = Event.of_error(kind("gone"), "agv")
    assert type(decode_event(encode_event(event)).as_error()) is kind
    assert type(replace(event, kind="annotations").as_error()) is LinkError


@every_codec
def test_another_version_is_refused(codec: Any) -> None:
    payload = bytearray(codec[1](_one(codec)))
    payload[4] = 1
    with pytest.raises(MessageError, match=r"another version: 1 \(limit: 3\)"):
        codec[2](bytes(payload))


@every_codec
def test_another_kind_is_refused(codec: Any) -> None:
    for other in CODECS.values():
        if other is not codec:
            with pytest.raises(MessageError, match="another kind"):
                codec[2](other[1](_one(other)))


@every_codec
def test_an_oversized_message_is_refused_unread(codec: Any) -> None:
    with pytest.raises(MessageError, match="too long"):
        codec[2](bytes(MAX_MESSAGE_BYTES + 1))


def test_more_frames_than_a_message_holds_are_refused() -> None:
    many = np.zeros(MAX_ROWS + 1)
    frames = Frames(many, many, many, many, many.astype(bool), many.astype(int), many, many)
    with pytest.raises(MessageError, match="too many frames"):
        encode_frames(FramesMessage(1, pack_columns(frames)))
    encode_frames(FramesMessage(1, pack_columns(frames.select(np.arange(MAX_ROWS)))))


def test_columns_that_differ_in_length_are_refused() -> None:
    two, three = np.zeros(2), np.zeros(3)
    frames = Frames(two, three, two, two, two.astype(bool), two.astype(int), two, two)
    with pytest.raises(MessageError, match="differ in length"):
        encode_frames(FramesMessage(1, pack_columns(frames)))


@pytest.mark.parametrize("hold_s", [-0.1, math.nan, math.inf, 3600.1])
def test_a_hold_out_of_range_is_refused(hold_s: float) -> None:
    with pytest.raises(MessageError, match="hold"):
        encode_command(CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), hold_s))


def test_a_command_takes_64_bytes_and_a_frame_57() -> None:
    assert len(encode_command(CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), 0.1))) == 64
    one = np.zeros(1)
    frames = Frames(one, one, one, one, one.astype(bool), one.astype(int), one, one)
    assert len(encode_frames(FramesMessage(1, pack_columns(frames)))) == 48 + 57


def test_columns_of_other_types_and_strides_travel_as_the_same_bytes() -> None:
    plain = Frames(*(np.arange(4.0) + k for k in range(4)), np.ones(4, bool), np.arange(4), np.zeros(4), np.ones(4))
    table = np.column_stack([plain.t_s, plain.x_m])
    odd = replace(plain, t_s=table[:, 0], x_m=table[:, 1], y_m=plain.y_m.astype(np.float32), frame=np.arange(4, dtype=np.int32))  # fmt: skip  # noqa: E501
    assert pack_columns(odd) == pack_columns(plain)
    assert pack_columns(replace(plain, t_s=table[:, 0])) == pack_columns(plain)
