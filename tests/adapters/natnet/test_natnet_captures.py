"""Captured streams: ``agvbench mocap --decode`` on pcap, pcapng and single datagrams, whole and damaged."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dpkt
import pytest
from streams import drawn

from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.encode import encode_descriptions, encode_frame
from agvbench.adapters.natnet.protocol.packet import Message, join
from agvbench.adapters.natnet.protocol.server_info import ServerInfo, encode_server_info
from agvbench.cli import main

V41 = Version(4, 1)
CLIENT, SERVER = b"\x0a\x00\x00\x02", b"\x0a\x00\x00\x01"
MTU = 1480


def session(version: Version = V41, asked: str | None = None) -> list[bytes]:
    """Return a handshake, model definitions and two frames, as packets."""
    frame, models = drawn(25)
    streamed = V41 if asked is None else Version.parse(asked)
    packets = [
        join(Message.CONNECT, b"Ping\0"),
        join(Message.SERVERINFO, encode_server_info(ServerInfo("Motive", "3.0.1.1", version, 1000, 1511, None))),
        join(Message.REQUEST, f"Bitstream,{asked}\0".encode() if asked else b"FrameRate\0"),
        join(Message.RESPONSE, struct.pack("<f", 120.0)),
        join(Message.FRAMEOFDATA, encode_frame(frame, streamed, models)),
        join(Message.REQUEST_MODELDEF),
        join(Message.MODELDEF, encode_descriptions(models, streamed)),
        join(Message.FRAMEOFDATA, encode_frame(frame, streamed, models)),
        join(Message.KEEPALIVE),
    ]
    assert len(packets[4]) > 2 * MTU
    return packets


def internet(packets: list[bytes]) -> list[bytes]:
    """Return IP packets, in fragments where they have to be."""
    sent = []
    for number, packet in enumerate(packets):
        udp = bytes(dpkt.udp.UDP(sport=1511, dport=50000, ulen=8 + len(packet), data=packet))
        for start in range(0, len(udp), MTU):
            part = udp[start : start + MTU]
            ip = dpkt.ip.IP(src=SERVER, dst=CLIENT, p=17, id=number, data=part, len=20 + len(part))
            ip.offset, ip.mf = start, int(start + MTU < len(udp))
            sent.append(bytes(ip))
    return sent


def ethernet(ip: bytes) -> bytes:
    """Return the IP packet on a network cable."""
    return bytes(dpkt.ethernet.Ethernet(src=b"\2" * 6, dst=b"\4" * 6, type=0x0800))[:14] + ip


def written(path: Path, writer: Callable[..., Any], link: int, packets: list[bytes]) -> Path:
    """Return a capture."""
    with path.open("wb") as file:
        capture = writer(file, linktype=link) if writer is dpkt.pcap.Writer else writer(file)
        for number, packet in enumerate(packets):
            capture.writepkt(packet, ts=float(number + 1))
    return path


def decode(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, list[dict[str, Any]], str]:
    """Return exit code, lines and what was complained about."""
    code = main(["mocap", "--decode", str(path), *options])
    out, err = capsys.readouterr()
    return code, [json.loads(line) for line in out.splitlines()], err


def check(lines: list[dict[str, Any]]) -> None:
    """Fail unless the lines tell the session."""
    names = ["CONNECT", "SERVERINFO", "REQUEST", "RESPONSE", "FRAMEOFDATA", "REQUEST_MODELDEF", "MODELDEF"]
    assert [line["message"] for line in lines] == [*names, "FRAMEOFDATA", "KEEPALIVE"]
    frame, _ = drawn(25)
    for line in (lines[4], lines[7]):
        assert (line["frame"], line["timestamp_s"], len(line["bodies"])) == (4711, 12.5, 25)
        for body, true in zip(line["bodies"], frame.bodies, strict=True):
            assert body["position_m"] == pytest.approx(true["position_m"].tolist(), rel=1e-8)
            assert body["quaternion"] == pytest.approx(true["quaternion"].tolist(), rel=1e-8)
            assert body["tracked"] == bool(true["flags"] & 1)
            assert body["mean_error_m"] == pytest.approx(float(true["mean_error_m"]), rel=1e-8)
    assert "name" not in lines[4]["bodies"][0]
    assert [body["name"] for body in lines[7]["bodies"]] == [f"agv{number}" for number in range(1, 26)]


@pytest.mark.parametrize("kind", ["pcap", "raw pcap", "pcapng"])
def test_a_capture_is_told_packet_by_packet(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = bytes(dpkt.udp.UDP(sport=53, dport=5353, data=b"\x12\x34\x01\x00 not NatNet"))
    dns = bytes(dpkt.ip.IP(src=SERVER, dst=CLIENT, p=17, id=99, data=other, len=20 + len(other)))
    packets = [dns, *internet(session())]
    if kind != "raw pcap":
        packets = [*map(ethernet, packets), b"\xff" * 60]
    writer = dpkt.pcapng.Writer if kind == "pcapng" else dpkt.pcap.Writer
    path = written(tmp_path / "stream", writer, 101 if kind == "raw pcap" else 1, packets)
    code, lines, err = decode(path, capsys)
    assert (code, err) == (0, "")
    check(lines)


def test_a_client_may_have_asked_for_another_version(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    packets = internet(session(Version(4, 2), asked="4.0"))
    code, lines, _ = decode(written(tmp_path / "s", dpkt.pcap.Writer, 101, packets), capsys)
    assert code == 0
    check(lines)


def test_a_file_may_hold_one_datagram(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "one.bin"
    path.write_bytes(session()[4])
    code, lines, err = decode(path, capsys)
    assert (code, lines) == (2, [])
    assert err == f"agvbench mocap: {path}: the version of the stream is not known; say it: --natnet-version 4.1\n"
    code, lines, _ = decode(path, capsys, "--natnet-version", "4.1")
    assert (code, lines[0]["frame"]) == (0, 4711)


def test_what_can_be_decoded_is_told_before_the_damage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    packets = session()
    packets[4] = packets[4][:12] + b"\xff" * 4 + packets[4][16:]
    code, lines, err = decode(written(tmp_path / "s", dpkt.pcap.Writer, 101, internet(packets)), capsys)
    assert (code, len(lines)) == (2, len(packets) - 1)
    assert "(1 of 9 packets)" in err
    assert err.count("\n") == 1


CONTENTS = {
    "no handshake in the file": session()[4],
    "file of another kind": bytes(70_000),
    "empty file": b"",
    "datagram of another protocol": b"\x63\x00\x00\x00",
    "capture without NatNet packets": struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101),
    "capture that was cut off": b"\xd4\xc3\xb2\xa1\x02",
}
OPTIONS = {
    "not a version": ["--natnet-version", "four"],
    "unsupported version": ["--natnet-version", "9.9"],
    "no action requested": None,
}
PAGE = Path(__file__).parents[3] / "docs" / "reference" / "errors-natnet.md"
LINES = dict(re.findall(r"^\| ([^|]+) \| `(.+)` \|$", PAGE.read_text(), re.MULTILINE))


@pytest.mark.parametrize("mistake", LINES)
def test_bad_input_gets_the_line_of_the_page(mistake: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad"
    if mistake == "pipe or device":
        path.symlink_to("/dev/zero")
    if mistake in CONTENTS:
        path.write_bytes(CONTENTS[mistake])
    options = OPTIONS.get(mistake, [])
    assert main(["mocap", *([] if options is None else ["--decode", str(path), *options])]) == 2
    assert capsys.readouterr().err == LINES[mistake].replace("FILE:", f"{path}:", 1) + "\n"


def test_every_mistake_of_the_page_is_tried() -> None:
    assert {*CONTENTS, *OPTIONS} | {"missing file", "pipe or device"} == {*LINES}


def test_a_datagram_that_is_cut_off_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cut"
    path.write_bytes(session()[4][:100])
    code, lines, err = decode(path, capsys, "--natnet-version", "4.1")
    assert (code, lines) == (2, [])
    assert err == f"agvbench mocap: {path}: NatNet packet is cut off: 100 B (limit: 6067 B)\n"


def test_a_capture_that_is_too_long_is_not_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "long.pcap"
    with path.open("wb") as file:
        file.truncate((2 << 30) + 1)  # takes no room on the disk
    code, lines, error = decode(path, capsys)
    assert (code, lines) == (2, [])
    assert "long.pcap: capture is too long" in error


def test_pieces_that_never_become_whole_are_let_go(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first_pieces = []
    for number in range(1000):
        ip = dpkt.ip.IP(src=SERVER, dst=CLIENT, p=17, id=number, data=bytes(64), len=84)
        ip.offset, ip.mf = 0, 1
        first_pieces.append(bytes(ip))
    whole = internet(session()[:2])
    path = written(tmp_path / "pieces.pcap", dpkt.pcap.Writer, 101, [*first_pieces, *whole])
    code, lines, _ = decode(path, capsys)
    assert code == 0
    assert [line["message"] for line in lines] == ["CONNECT", "SERVERINFO"]
