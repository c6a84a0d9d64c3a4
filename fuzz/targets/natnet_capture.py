"""Captured traffic, pcap and pcapng, down to UDP datagrams."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path

from fuzz.natnet_samples import packets
from fuzz.target import FileTarget


class NatNetCapture(FileTarget):
    """A capture file."""

    name = "natnet_capture"
    instruments = ("agvbench.adapters.natnet.capture", "dpkt")
    suffix = ".pcap"
    longest = 4096

    def __init__(self) -> None:
        super().__init__()
        import dpkt  # noqa: F401  (instrumented, too)

        from agvbench.adapters.natnet.capture import datagrams_of

        self._datagrams_of = datagrams_of

    def seeds(self) -> Iterable[bytes]:
        """Return captures of both formats, on several links, whole and in fragments."""
        import dpkt

        payload = next(packets((4, 1)))
        udp = bytes(dpkt.udp.UDP(sport=1511, dport=50_000, ulen=8 + len(payload), data=payload))
        whole = dpkt.ip.IP(src=b"\x0a\0\0\1", dst=b"\x0a\0\0\2", p=17, id=1, data=udp, len=20 + len(udp))
        first, rest = _fragment(udp[:64], 0, more=True), _fragment(udp[64:], 64, more=False)
        ethernet = bytes(dpkt.ethernet.Ethernet(src=bytes(6), dst=bytes(6), type=0x0800))[:14]
        six = bytes(dpkt.ip6.IP6(nxt=17, plen=len(udp), hlim=64, src=bytes(16), dst=bytes(16), data=udp))
        for link, before in ((1, ethernet), (101, b""), (108, b"\2\0\0\0"), (113, bytes(14) + b"\x08\0")):
            yield _written(link, [before + bytes(whole), before + first, before + rest])
        yield _written(101, [six])
        buffer = io.BytesIO()
        writer = dpkt.pcapng.Writer(buffer)
        writer.writepkt(ethernet + bytes(whole), ts=1.0)
        yield buffer.getvalue()
        yield payload

    def read(self, path: Path) -> None:
        """Read all datagrams."""
        for datagram in self._datagrams_of(path):
            assert len(datagram.data) <= 65_535


def _fragment(part: bytes, offset: int, *, more: bool) -> bytes:
    import dpkt

    ip = dpkt.ip.IP(src=b"\x0a\0\0\1", dst=b"\x0a\0\0\2", p=17, id=2, data=part, len=20 + len(part))
    ip.offset, ip.mf = offset, int(more)
    return bytes(ip)


def _written(link: int, sent: list[bytes]) -> bytes:
    import dpkt

    buffer = io.BytesIO()
    writer = dpkt.pcap.Writer(buffer, linktype=link)
    for number, packet in enumerate(sent):
        writer.writepkt(packet, ts=float(number))
    return buffer.getvalue()
