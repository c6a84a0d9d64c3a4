"""Captured datagrams: pcap and pcapng, as tcpdump and Wireshark write them, or a file that holds one datagram.

Frames of many markers do not fit a network packet: IP sends them in fragments, which are put together again here.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from agvbench.adapters.natnet.protocol.packet import MAX_DATAGRAM_BYTES
from agvbench.errors import FileError
from agvbench.text_files import require_regular

_PCAP = (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_MAX_CAPTURE_BYTES = 2 << 30
_MAX_UNFINISHED = 256
_UDP = struct.Struct(">4H")
_UDP_PROTOCOL = 17
# Link types: BSD loopback, Ethernet, raw IP (three numbers), Linux "cooked" (two).
_NULL, _ETHERNET, _RAW, _SLL, _SLL2 = (0, 108), (1,), (12, 101, 228), (113,), (276,)


class Datagram(NamedTuple):
    """A UDP datagram; ``time_s`` [s] is when it was captured, -1 where that is not known."""

    time_s: float
    data: bytes


def datagrams_of(path: Path) -> Iterator[Datagram]:
    """Give the UDP datagrams of a capture, in order; those of IPv6 in one piece only.

    Raises
    ------
    FileError
        If the file is missing, no regular file, no capture, and too long for one datagram; or if a capture is damaged,
        after what stands before the damage.
    """
    try:
        require_regular(path)
        size = path.stat().st_size
        if size > _MAX_CAPTURE_BYTES:
            raise FileError("capture is too long", where=path, value=f"{size} B", limit=f"{_MAX_CAPTURE_BYTES} B")
        data = path.read_bytes()
    except OSError as error:
        raise FileError("cannot be read", where=path, value=error.strerror) from None
    if data[:4] in {*_PCAP, _PCAPNG}:
        yield from _captured(data, path)
    elif len(data) <= MAX_DATAGRAM_BYTES:
        yield Datagram(-1.0, data)
    else:
        raise FileError(
            "neither pcap, pcapng nor one datagram", where=path, value=f"{len(data)} B",
            limit=f"{MAX_DATAGRAM_BYTES} B for one datagram", remedy="capture with: tcpdump -w FILE udp",
        )  # fmt: skip


def _captured(data: bytes, path: Path) -> Iterator[Datagram]:
    import dpkt

    unfinished: dict[Any, dict[int, tuple[bool, bytes]]] = {}
    try:
        reader = dpkt.pcap.UniversalReader(io.BytesIO(data))
        link = reader.datalink()
        for time_s, packet in reader:
            datagram = _udp_of(bytes(packet), link, unfinished)
            if datagram is not None:
                yield Datagram(float(time_s), datagram)
    except (dpkt.Error, ValueError, struct.error, IndexError, KeyError, TypeError) as error:
        raise FileError("capture is damaged", where=path, value=f"{type(error).__name__}: {error}") from None


def _udp_of(packet: bytes, link: int, unfinished: dict[Any, dict[int, tuple[bool, bytes]]]) -> bytes | None:
    """Return the payload of the UDP datagram that `packet` is or completes."""
    import dpkt

    try:
        inner = _network_layer(packet, link)
    except (dpkt.UnpackError, struct.error, AttributeError, IndexError, KeyError, TypeError):
        # One packet that cannot be taken apart (dpkt says so in many ways) does not spoil the capture.
        return None
    if isinstance(inner, dpkt.ip6.IP6):
        return _payload(bytes(inner.data)) if inner.nxt == _UDP_PROTOCOL else None
    if not isinstance(inner, dpkt.ip.IP) or inner.p != _UDP_PROTOCOL:
        return None
    whole = _put_together(inner, unfinished)
    return None if whole is None else _payload(whole)


def _network_layer(packet: bytes, link: int) -> Any:
    """Return the IP packet behind a link layer's header."""
    import dpkt

    if link in _ETHERNET:
        return dpkt.ethernet.Ethernet(packet).data
    if link in _SLL:
        return dpkt.sll.SLL(packet).data
    if link in _SLL2:
        return dpkt.sll2.SLL2(packet).data
    if link in _NULL:
        packet = packet[4:]
    elif link not in _RAW:
        raise ValueError(f"link type {link} is not supported")
    return dpkt.ip6.IP6(packet) if packet[:1] and packet[0] >> 4 == 6 else dpkt.ip.IP(packet)


def _put_together(packet: Any, unfinished: dict[Any, dict[int, tuple[bool, bytes]]]) -> bytes | None:
    """Return what an IP packet carries once all its fragments are there."""
    offset, more, data = int(packet.offset), bool(packet.mf), bytes(packet.data)
    if offset == 0 and not more:
        return data
    key = (packet.src, packet.dst, packet.id)
    parts = unfinished.setdefault(key, {})
    parts[offset] = (more, data)
    if len(unfinished) > _MAX_UNFINISHED:
        del unfinished[next(iter(unfinished))]
    whole = b""
    for start in sorted(parts):
        more, data = parts[start]
        if start != len(whole) or len(whole) + len(data) > MAX_DATAGRAM_BYTES:
            return None
        whole += data
    if more:
        return None
    unfinished.pop(key, None)
    return whole


def _payload(udp: bytes) -> bytes | None:
    """Return what a UDP packet carries, None if it is cut off."""
    if len(udp) < _UDP.size:
        return None
    _, _, length, _ = _UDP.unpack_from(udp)
    return udp[_UDP.size : length] if _UDP.size <= length <= len(udp) else None
