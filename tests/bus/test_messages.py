"""Messages: what is encoded is decoded again, and nothing else is ever decoded."""

from __future__ import annotations

import math
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agvbench import errors
from agvbench.bus.messages.codec import MAX_MESSAGE_BYTES, MAX_ROWS, MAX_TEXT, VERSION, decoder, encode
from agvbench.bus.messages.command import CommandMessage, decode_command
from agvbench.bus.messages.event import Event, Level, decode_event
from agvbench.bus.messages.frames import FrameClock, FramesMessage, pack_columns, unpack_columns
from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity, decode_agv_identity, decode_mocap_identity
from agvbench.bus.messages.request import (
    ClaimMessage,
    Replay,
    Reset,
    Sampling,
    TimeMessage,
    decode_claim,
    decode_replay,
    decode_reset,
    decode_sampling,
    decode_time,
)
from agvbench.bus.messages.runner_state import Phase, RunnerState, RunProgress, RunResult, decode_runner_state
from agvbench.bus.messages.truth import Truth, decode_truth
from agvbench.errors import LinkError, MessageError, PlanError
from agvbench.registry import own_classes
from agvbench.types import Command, Commands, Frames, Pose
from agvbench.vehicle.channels import Channel, Channels

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


@st.composite
def frame_messages(draw: st.DrawFn) -> FramesMessage:
    frames = draw(frame_batches())
    clock, now_s, flags = draw(st.sampled_from(FrameClock)), draw(finite), draw(st.integers(0, 1))
    return FramesMessage(draw(u64), len(frames), pack_columns(frames), draw(u64), clock, now_s, flags, draw(u32))


details = (st.none() | text,) * 4
events = st.builds(Event, u64, text, st.sampled_from(Level), text, text, u64, finite, u32, *details)
channels = st.builds(
    lambda ends, unit: Channel(unit, ends[1], ends[0], ends[2]),
    st.lists(finite, min_size=3, max_size=3, unique=True).map(sorted),
    st.sampled_from(["us", "normalised", "si"]),
) | st.builds(Channel, st.just("us"), finite)
agv_identities = st.builds(
    AgvIdentity,
    *(text,) * 4,
    st.builds(Channels, channels, channels, channels),
    st.booleans(),
    st.booleans(),
    st.dictionaries(text, text, max_size=4),
)
mocap_identities = st.builds(MocapIdentity, text, rate, st.booleans(), st.dictionaries(text, text, max_size=4))

poses = st.builds(Pose, finite, finite, finite)
positive, small = st.floats(0.0, 1e300), st.integers(0, 1000)
progresses = st.builds(
    lambda more, number, *others: RunProgress(number, number + more, *others),
    small, small, *(text,) * 4, small, small, finite, positive,
)  # fmt: skip
results = st.builds(RunResult, text, text, st.none() | finite, st.none() | finite)
runner_states = st.builds(
    RunnerState, u64, u32, text, text, st.sampled_from(Phase), positive, positive,
    run=st.none() | progresses,
    pose=st.none() | poses,
    command=st.none() | st.builds(Command, finite, finite, finite),
    counted=small,
    rejected=small,
    faults=st.lists(text, max_size=8).map(tuple),
    fault_count=small,
    results=st.lists(results, max_size=8).map(tuple),
    failure=st.none() | text,
)  # fmt: skip

CODECS: dict[str, tuple[Any, Callable[[bytes], Any]]] = {
    "command": (commands, decode_command),
    "frames": (frame_messages(), decoder(FramesMessage)),
    "event": (events, decode_event),
    "agv_identity": (agv_identities, decode_agv_identity),
    "mocap_identity": (mocap_identities, decode_mocap_identity),
    "reset": (resets, decode_reset),
    "sampling": (samplings, decode_sampling),
    "replay": (replays(), decode_replay),
    "time": (st.builds(TimeMessage, finite), decode_time),
    "claim": (st.builds(ClaimMessage, u32), decode_claim),
    "truth": (truths(), decode_truth),
    "runner_state": (runner_states, decode_runner_state),
}
few = settings(max_examples=40, deadline=None)
every_codec = pytest.mark.parametrize("codec", CODECS.values(), ids=list(CODECS))


def same(left: Any, right: Any) -> bool:
    """Compare messages field by field; arrays bit by bit, so that NaN equals NaN."""
    if isinstance(left, np.ndarray):
        return left.shape == right.shape and left.astype(right.dtype).tobytes() == np.ascontiguousarray(right).tobytes()
    if hasattr(left, "__dataclass_fields__") or isinstance(left, msgspec.Struct):
        names = getattr(left, "__struct_fields__", None) or left.__dataclass_fields__
        return all(same(getattr(left, name), getattr(right, name)) for name in names)
    if isinstance(left, tuple):
        return len(left) == len(right) and all(map(same, left, right))
    return bool(left == right) or (isinstance(left, float) and math.isnan(left) and math.isnan(right))


@every_codec
@few
@given(data=st.data())
def test_what_is_encoded_is_decoded(codec: Any, data: st.DataObject) -> None:
    strategy, decode = codec
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
    strategy, decode = codec
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
    strategy, decode = codec
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
        codec[1](payload)


@every_codec
@few
@given(data=st.data())
def test_noise_behind_a_good_beginning_raises_nothing_else(codec: Any, data: st.DataObject) -> None:
    payload = encode(_one(codec))
    with suppress(MessageError):
        codec[1](payload[: data.draw(st.integers(0, len(payload)))] + data.draw(st.binary(max_size=200)))


leaves = st.none() | st.booleans() | u64 | anything | text | st.binary(max_size=20)
things = st.recursive(leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(text, inner, max_size=3))


@every_codec
@few
@given(data=st.data())
def test_a_field_of_any_other_type_is_refused_or_well_formed(codec: Any, data: st.DataObject) -> None:
    version, fields = msgspec.msgpack.decode(encode(_one(codec)))
    fields[data.draw(st.sampled_from(sorted(fields)))] = data.draw(things)
    try:
        message = codec[1](msgspec.msgpack.encode([version, fields]))
    except MessageError:
        return
    assert same(codec[1](encode(message)), message)


@every_codec
def test_a_missing_or_an_unknown_field_is_refused(codec: Any) -> None:
    version, fields = msgspec.msgpack.decode(encode(_one(codec)))
    with pytest.raises(MessageError, match="unknown field 'more'"):
        codec[1](msgspec.msgpack.encode([version, {**fields, "more": 1}]))
    for incomplete in ({}, {"type": fields["type"]}, {k: v for k, v in fields.items() if k != "type"}):
        with pytest.raises(MessageError, match="cannot be decoded"):
            codec[1](msgspec.msgpack.encode([version, incomplete]))


HUGE = (b"\xc6", b"\xdb", b"\xdd", b"\xdf", b"\xc9")
"""Binary, text, array, map and extension, whose length of four bytes follows."""


@every_codec
@pytest.mark.parametrize("marker", HUGE)
def test_a_huge_declared_size_takes_no_memory(codec: Any, marker: bytes) -> None:
    payload = encode(_one(codec))
    first = payload.index(next(iter(f.encode() for f in msgspec.msgpack.decode(payload)[1] if f != "type")))
    tracemalloc.start()
    try:
        for start in (b"", b"\x92\x04", payload[:first], payload[: payload.index(b"type") + 4]):
            with pytest.raises(MessageError):
                codec[1](start + marker + b"\xff\xff\xff\xff" + bytes(50))
        assert tracemalloc.get_traced_memory()[1] < 10 * MAX_MESSAGE_BYTES
    finally:
        tracemalloc.stop()


@every_codec
def test_deep_nesting_is_refused(codec: Any) -> None:
    fields = msgspec.msgpack.decode(encode(_one(codec)))[1]
    for marker in (b"\x91", b"\x81\xa1x"):
        for name in fields:
            deep = msgspec.Raw(marker * 100_000 + b"\xc0")
            with pytest.raises(MessageError):
                codec[1](msgspec.msgpack.encode([VERSION, {**fields, name: deep}]))
        with pytest.raises(MessageError):
            codec[1](marker * 100_000)
        with pytest.raises(MessageError):
            codec[1](b"\x92\x05" + marker * 100_000)


def test_any_reader_of_messagepack_can_read_a_message() -> None:
    """Names, values and packed numbers, without anything of this package."""
    one = np.array([1.5])
    frames = Frames(one, one + 1.0, one + 2.0, one, np.array([True]), np.array([7]), one, one)
    version, fields = msgspec.msgpack.decode(encode(FramesMessage(3, 1, pack_columns(frames), 2, FrameClock.ADAPTER)))
    assert (version, fields["type"], fields["sequence"], fields["count"], fields["clock"]) == (6, "frames", 3, 1, 1)
    assert struct.unpack("<6dqB", fields["columns"]) == (1.5, 2.5, 3.5, 1.5, 1.5, 1.5, 7, 1)
    version, fields = msgspec.msgpack.decode(encode(CommandMessage(1, 0.5, Command(1700.0, 1500.0, 1400.0), 0.1)))
    assert (fields["command"], fields["hold_s"]) == ([1700.0, 1500.0, 1400.0], 0.1)


def test_whole_numbers_are_read_where_numbers_are_meant() -> None:
    fields = {"type": "command", "sequence": 1, "t_s": 0, "command": [1700, 1500, 1500], "hold_s": 1}
    message = decode_command(msgspec.msgpack.encode([VERSION, fields]))
    assert message == CommandMessage(1, 0.0, Command(1700.0, 1500.0, 1500.0), 1.0)


def _one(codec: Any) -> Any:
    name = next(name for name, entry in CODECS.items() if entry is codec)
    pose = Pose(0.0, 0.0, 0.0)
    reset = Reset("run", pose, Sampling(120.0, 0.0))
    none = np.empty(0)
    return {
        "command": CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), 0.1),
        "frames": FramesMessage(1, 0, b""),
        "event": Event(1, "agv", Level.INFO, "kind", "text"),
        "agv_identity": AgvIdentity("a", "b", "c", "d", Channels.alike("us"), True, True),
        "mocap_identity": MocapIdentity("a", 120.0, True),
        "reset": reset,
        "sampling": Sampling(120.0, 0.0),
        "replay": Replay(reset, Commands(none, none, none, none), 0.0),
        "time": TimeMessage(0.0),
        "claim": ClaimMessage(7),
        "truth": Truth(1, 1, 0.0, none, np.empty((0, 3))),
        "runner_state": RunnerState(1, 7, "campaign", "1.0", Phase.DRIVING, 0.0, 0.0),
    }[name]


def test_an_error_arrives_with_all_its_fields() -> None:
    sent = PlanError("radius is too small", where="plan", value="0.2 m", limit="0.3 m", remedy="widen the turn")
    error = decode_event(encode(Event.of_error(sent, "agv"))).as_error()
    assert type(error) is PlanError
    assert (error.what, error.where, error.value, error.limit, error.remedy) == (
        "radius is too small", "agv adapter: plan", "0.2 m", "0.3 m", "widen the turn",
    )  # fmt: skip
    bare = decode_event(encode(Event.of_error(LinkError("gone"), "agv"))).as_error()
    assert (str(bare), bare.remedy) == ("agv adapter: gone", None)


@pytest.mark.parametrize("kind", own_classes(errors, errors.AgvbenchError))
def test_every_class_of_error_arrives(kind: type[errors.AgvbenchError]) -> None:
    event = Event.of_error(kind("gone"), "agv")
    assert type(decode_event(encode(event)).as_error()) is kind
    assert type(msgspec.structs.replace(event, kind="annotations").as_error()) is LinkError


@every_codec
def test_another_encoding_is_refused_with_the_remedy(codec: Any) -> None:
    fields = msgspec.msgpack.decode(encode(_one(codec)))[1]
    later = ([7, fields], [7, {**fields, "more": 1}], [7], [7, "a", "b"], [4, fields], [2**64 - 1, fields])
    for payload in (b"AGVB\x03" + bytes(59), b"AGVB\x01", *map(msgspec.msgpack.encode, later)):
        with pytest.raises(MessageError, match=r"another encoding: \d+ \(limit: 6\); install the same agvbench"):
            codec[1](payload)


@every_codec
def test_another_kind_is_refused(codec: Any) -> None:
    for other in CODECS.values():
        if other is not codec:
            with pytest.raises(MessageError, match="another kind"):
                codec[1](encode(_one(other)))


@every_codec
def test_an_oversized_message_is_refused_unread(codec: Any) -> None:
    with pytest.raises(MessageError, match="too long"):
        codec[1](bytes(MAX_MESSAGE_BYTES + 1))


def test_more_frames_than_a_message_holds_are_refused() -> None:
    many = np.zeros(MAX_ROWS + 1)
    frames = Frames(many, many, many, many, many.astype(bool), many.astype(int), many, many)
    with pytest.raises(MessageError, match="too many frames"):
        FramesMessage(1, len(frames), pack_columns(frames))
    FramesMessage(1, MAX_ROWS, pack_columns(frames.select(np.arange(MAX_ROWS))))


def test_columns_that_differ_in_length_are_refused() -> None:
    two, three = np.zeros(2), np.zeros(3)
    frames = Frames(two, three, two, two, two.astype(bool), two.astype(int), two, two)
    with pytest.raises(MessageError, match="differ in length"):
        pack_columns(frames)


@pytest.mark.parametrize("count", [0, 2, MAX_ROWS])
def test_columns_that_do_not_fit_their_count_are_refused(count: int) -> None:
    fields = {"type": "frames", "sequence": 1, "count": count, "columns": bytes(57)}
    with pytest.raises(MessageError, match="do not fit their count"):
        decoder(FramesMessage)(msgspec.msgpack.encode([VERSION, fields]))


def test_a_text_of_an_event_is_cut_and_made_readable_and_no_other() -> None:
    event = decode_event(encode(Event(1, "agv", Level.INFO, "kind", "x" * 5000, where="a\udcffb")))
    assert (event.text, event.where) == ("x" * MAX_TEXT, "a?b")
    with pytest.raises(MessageError, match="text cannot be sent"):
        encode(MocapIdentity("a\udcffb", 120.0, True))
    with pytest.raises(MessageError, match="length <= 4096"):
        decode_mocap_identity(encode(MocapIdentity("a" * 5000, 120.0, True)))
    with pytest.raises(MessageError, match="length <= 64"):
        decode_mocap_identity(encode(MocapIdentity("a", 120.0, True, {str(n): "" for n in range(65)})))


def test_numbers_of_numpy_travel_as_numbers() -> None:
    command = Command(np.float64(1700.0), 1500.0, 1500.0)
    sent = CommandMessage(np.int64(7), np.float64(0.5), command, np.float64(0.1))  # type: ignore[arg-type]
    assert decode_command(encode(sent)) == CommandMessage(7, 0.5, Command(1700.0, 1500.0, 1500.0), 0.1)
    camera = MocapIdentity("a", np.float64(120.0), np.bool_(True))  # type: ignore[arg-type]
    assert decode_mocap_identity(encode(camera)) == MocapIdentity("a", 120.0, True)
    with pytest.raises(MessageError, match="value cannot be sent: object"):
        encode(MocapIdentity("a", 120.0, object()))  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused(wrong: float) -> None:
    three, none = np.arange(3.0), np.empty(0)
    reset = Reset("run", Pose(0.0, 0.0, 0.0), Sampling(120.0, 0.0))
    for make in (
        lambda: CommandMessage(1, wrong, Command(0.0, 0.0, 0.0), 0.1),
        lambda: CommandMessage(1, 0.0, Command(0.0, wrong, 0.0), 0.1),
        lambda: TimeMessage(wrong),
        lambda: Sampling(120.0, wrong),
        lambda: Sampling(wrong, 0.0),
        lambda: Reset("run", Pose(0.0, wrong, 0.0), Sampling(120.0, 0.0)),
        lambda: Replay(reset, Commands(three, three, three + wrong, three), 0.0),
        lambda: Replay(reset, Commands(none, none, none, none), wrong),
        lambda: decode_truth(encode(Truth(1, 1, 0.0, three, np.full((3, 3), wrong)))),
        lambda: MocapIdentity("a", wrong, True),
    ):
        with pytest.raises(MessageError, match=r"finite|out of range"):
            make()
    sound = encode(AgvIdentity("a", "b", "c", "d", Channels.alike("us"), True, True))
    damaged = sound.replace(struct.pack(">d", 1500.0), struct.pack(">d", wrong), 1)
    assert damaged != sound
    with pytest.raises(MessageError, match=r"channels: neutral: must be a finite number"):
        decode_agv_identity(damaged)
    fields = {"type": "time", "now_s": wrong}
    with pytest.raises(MessageError, match="time is not finite"):
        decode_time(msgspec.msgpack.encode([VERSION, fields]))


def test_columns_of_commands_and_truth_must_fit_each_other() -> None:
    two, three = np.arange(2.0), np.arange(3.0)
    reset = Reset("run", Pose(0.0, 0.0, 0.0), Sampling(120.0, 0.0))
    with pytest.raises(MessageError, match="differ in length"):
        Replay(reset, Commands(three, three, two, three), 0.0)
    with pytest.raises(MessageError, match="go back in time"):
        Replay(reset, Commands(three[::-1], three, three, three), 0.0)
    with pytest.raises(MessageError, match="do not fit their times"):
        decode_truth(encode(Truth(1, 1, 0.0, three, np.zeros((2, 3)))))


@pytest.mark.parametrize("hold_s", [-0.1, math.nan, math.inf, 3600.1])
def test_a_hold_out_of_range_is_refused(hold_s: float) -> None:
    with pytest.raises(MessageError, match="hold"):
        CommandMessage(1, 0.0, Command(0.0, 0.0, 0.0), hold_s)


def test_columns_of_other_types_and_strides_travel_as_the_same_bytes() -> None:
    plain = Frames(*(np.arange(4.0) + k for k in range(4)), np.ones(4, bool), np.arange(4), np.zeros(4), np.ones(4))
    table = np.column_stack([plain.t_s, plain.x_m])
    odd = replace(plain, t_s=table[:, 0], x_m=table[:, 1], y_m=plain.y_m.astype(np.float32), frame=np.arange(4, dtype=np.int32))  # fmt: skip  # noqa: E501
    assert pack_columns(odd) == pack_columns(plain)
    assert pack_columns(replace(plain, t_s=table[:, 0])) == pack_columns(plain)
