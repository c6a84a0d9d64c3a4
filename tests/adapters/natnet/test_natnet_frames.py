"""Frames of data: right in every version, as independent clients read them, and from bytes put together by hand."""

from __future__ import annotations

import struct
from contextlib import suppress

import natnet.data_descriptions
import natnet.data_frame
import natnet.packet_buffer
import natnet.version
import numpy as np
import optirx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from streams import VERSIONS, drawn

from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.description import decode_descriptions
from agvbench.adapters.natnet.protocol.encode import encode_descriptions, encode_frame
from agvbench.adapters.natnet.protocol.frame import decode_frame
from agvbench.adapters.natnet.protocol.packet import Message, join, split
from agvbench.adapters.natnet.protocol.server_info import ServerInfo, decode_server_info, encode_server_info
from agvbench.errors import MessageError

every_version = pytest.mark.parametrize("version", VERSIONS, ids=str)


@every_version
def test_what_an_emulator_sends_is_read_again(version: Version) -> None:
    frame, models = drawn()
    read = decode_frame(encode_frame(frame, version, models), version, markers=True)
    same = [name for name in read.bodies.dtype.names or () if version >= (2, 6) or name != "flags"]
    assert (read.bodies[same] == frame.bodies[same]).all()
    assert (read.markers["position_m"] == frame.markers["position_m"]).all()
    assert (read.number, read.timestamp_s, read.flags) == (4711, 12.5, 0)
    assert read.exposed_ticks == (1_000 if version >= (3, 0) else -1)
    described = decode_descriptions(encode_descriptions(models, version), version)
    assert described == [(model.id, model.name) for model in models]


@every_version
def test_an_independent_client_reads_the_same_bodies(version: Version) -> None:
    frame, models = drawn(seed=1)
    payload = encode_frame(frame, version, models)
    buffer = natnet.packet_buffer.PacketBuffer(payload)
    theirs = natnet.data_frame.DataFrame.read_from_buffer(buffer, natnet.version.Version(*version)).rigid_bodies
    ours = decode_frame(payload, version)
    assert [body.id_num for body in theirs] == ours.bodies["id"].tolist()
    assert np.array_equal([body.pos for body in theirs], ours.bodies["position_m"])
    assert np.array_equal([body.rot for body in theirs], ours.bodies["quaternion"])
    if version >= (2, 6):
        assert [body.tracking_valid for body in theirs] == ours.tracked.tolist()


@every_version
def test_an_independent_client_reads_the_same_names(version: Version) -> None:
    _, models = drawn(seed=2)
    buffer = natnet.packet_buffer.PacketBuffer(encode_descriptions(models, version))
    theirs = natnet.data_descriptions.DataDescriptions.read_from_buffer(buffer, natnet.version.Version(*version))
    assert [(body.id_num, body.name) for body in theirs.rigid_bodies] == [(m.id, m.name) for m in models]


@pytest.mark.parametrize("version", [v for v in VERSIONS if Version(2, 6) <= v < Version(2, 11)], ids=str)
def test_another_client_reads_the_same_frame(version: Version) -> None:
    frame, models = drawn(seed=3)
    packet = join(Message.FRAMEOFDATA, encode_frame(frame, version, models))
    theirs = optirx.unpack(packet, (*version, 0, 0))
    assert [body.id for body in theirs.rigid_bodies] == frame.bodies["id"].tolist()
    assert np.array_equal([body.position for body in theirs.rigid_bodies], frame.bodies["position_m"])
    assert [body.tracking_valid for body in theirs.rigid_bodies] == frame.tracked.tolist()
    assert (theirs.frameno, theirs.timestamp) == (4711, 12.5)


def by_hand(version: Version, extra: bytes = b"") -> bytes:
    """Return a frame with everything in it that a server can send, put together field by field."""
    sized, parts = version >= (4, 1), [struct.pack("<i", 99)]

    def section(count: int, content: bytes) -> None:
        parts.append(struct.pack("<i", count) + (struct.pack("<i", len(content)) if sized else b"") + content)

    def body(number: int) -> bytes:
        pose = struct.pack("<i3f4f", number, 1.0, 2.0, 3.0, 0.0, 0.6, 0.0, 0.8)
        markers = b"" if version >= (3, 0) else struct.pack("<i", 2) + bytes(2 * 12 + 2 * 4 + 2 * 4)
        return pose + markers + struct.pack("<f", 0.0005) + (struct.pack("<h", 1) if version >= (2, 6) else b"")

    section(1, b"all\0" + struct.pack("<i3f", 1, 0, 0, 0))
    section(2, bytes(24))
    section(1, body(5))
    section(1, struct.pack("<ii", 77, 2) + body(1) + body(2))
    if version >= (4, 1):
        section(1, struct.pack("<ii", 8, 1) + body(9) + struct.pack("<i", 1) + bytes(26))
    marker = 20 + 2 * (version >= (2, 6)) + 4 * (version >= (3, 0))
    if version >= (2, 3):
        section(3, bytes(3 * marker))
    for since in ((2, 9), (2, 11)):
        if version >= since:
            section(1, struct.pack("<iiiffi", 3, 2, 2, 0.5, 0.5, 0))
    parts.append(extra)
    parts.append(b"" if version >= (3, 0) else struct.pack("<f", 0.01))
    parts.append(struct.pack("<II", 0, 0) + struct.pack("<d" if version >= (2, 7) else "<f", 3.25))
    parts.append(struct.pack("<QQQ", 11, 12, 13) if version >= (3, 0) else b"")
    parts.append(struct.pack("<II", 3, 0) if version >= (4, 1) else b"")
    return b"".join(parts) + struct.pack("<hi", 2, 0)


def check_by_hand(payload: bytes, version: Version) -> None:
    frame = decode_frame(payload, version, markers=True)
    assert (frame.number, frame.timestamp_s, frame.flags, len(frame.markers)) == (99, 3.25, 2, 3)
    assert frame.bodies["id"].tolist() == [5]
    assert frame.bodies["position_m"].tolist() == [[1.0, 2.0, 3.0]]
    assert frame.bodies["quaternion"].tolist() == np.array([[0.0, 0.6, 0.0, 0.8]], np.float32).tolist()
    assert frame.tracked.tolist() == [True]
    if version >= (3, 0):
        assert (frame.exposed_ticks, frame.received_ticks, frame.transmitted_ticks) == (11, 12, 13)


@every_version
def test_everything_that_is_not_wanted_is_passed_over(version: Version) -> None:
    check_by_hand(by_hand(version), version)


def test_sections_of_versions_to_come_are_passed_over() -> None:
    for extra in (struct.pack("<ii", 2, 10) + bytes(10), struct.pack("<iiii", 0, 0, 1, 0)):
        check_by_hand(by_hand(Version(4, 2), extra), Version(4, 3))


def test_version_2_5_may_end_without_a_time_stamp() -> None:
    payload = by_hand(Version(2, 5))
    frame = decode_frame(payload[:-10] + payload[-4:], Version(2, 5))
    assert np.isnan(frame.timestamp_s)
    assert frame.bodies["id"].tolist() == [5]


@every_version
def test_every_cut_off_frame_is_refused(version: Version) -> None:
    payload = by_hand(version)
    needed = len(payload) - (10 if version < (2, 6) else 4)  # without the end tag, and what 2.5 may leave out
    for length in range(needed):
        with pytest.raises(MessageError):
            decode_frame(payload[:length], version)


@given(st.sampled_from(VERSIONS), st.data())
def test_damage_ends_in_a_frame_or_in_one_clear_error(version: Version, data: st.DataObject) -> None:
    payload = bytearray(by_hand(version))
    for at in data.draw(st.lists(st.integers(0, len(payload) - 1), max_size=4)):
        payload[at] = data.draw(st.integers(0, 255))
    try:
        frame = decode_frame(bytes(payload), version, markers=True)
    except MessageError:
        return
    assert len(frame.bodies) * 34 + len(frame.markers) * 20 <= len(payload)


@given(st.binary(max_size=600), st.sampled_from(VERSIONS))
def test_noise_ends_in_a_message_or_in_one_clear_error(noise: bytes, version: Version) -> None:
    for decode in (lambda: split(noise), lambda: decode_frame(noise, version), lambda: decode_server_info(noise),
                   lambda: decode_descriptions(noise, version)):  # fmt: skip
        with suppress(MessageError):
            decode()


@pytest.mark.parametrize("multicast", [None, "239.255.42.99"])
def test_a_server_says_who_it_is(multicast: str | None) -> None:
    info = ServerInfo("Motive", "3.0.1.1", Version(4, 1), 10_000_000, 1511, multicast)
    assert decode_server_info(encode_server_info(info)) == info
    old = ServerInfo("Arena", "1.8.0.0", Version(2, 9))
    assert decode_server_info(encode_server_info(old)) == old


@pytest.mark.parametrize(("text", "said"), [("4", "not a NatNet version"), ("5.0", "not supported"), ("2.4", "2.5 to")])
def test_versions_that_cannot_be_read_are_refused(text: str, said: str) -> None:
    with pytest.raises(MessageError, match=said):
        Version.parse(text)
