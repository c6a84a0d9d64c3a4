"""A captured stream on standard output: a JSON line a packet."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TextIO

from agvbench.adapters.natnet.capture import Datagram, datagrams_of
from agvbench.adapters.natnet.json_lines import Transcript
from agvbench.adapters.natnet.packet import HEADER_BYTES, Message
from agvbench.adapters.natnet.version import Version
from agvbench.errors import FileError, MessageError


def print_packets(path: Path, version: str | None = None, out: TextIO | None = None) -> None:
    """Print every NatNet packet of a file; other traffic is left out.

    Parameters
    ----------
    path
        A pcap, pcapng, or a file that holds one datagram.
    version
        Of the bit stream, as ``"4.1"``; None to take it from the handshake.
    out
        Where to; standard output if None.

    Raises
    ------
    FileError
        If the file cannot be read, is damaged, holds no NatNet packet, or some that cannot be decoded: after all
        others were printed.
    MessageError
        If `version` is none.
    """
    transcript = Transcript(None if version is None else Version.parse(version))
    out = out or sys.stdout
    good, failed, first = 0, 0, None
    for datagram in datagrams_of(path):
        if not _may_be_natnet(datagram):
            continue
        try:
            line = transcript.told(datagram.data)
        except MessageError as error:
            failed, first = failed + 1, first or error
            continue
        good += 1
        print(json.dumps(line, allow_nan=False, ensure_ascii=False), file=out)
    if first is not None:
        share = "" if good + failed == 1 else f" ({failed} of {good + failed} packets)"
        raise FileError(f"{first.what}{share}", where=path, value=first.value, limit=first.limit, remedy=first.remedy)
    if not good:
        raise FileError("no NatNet packet", where=path, remedy="capture with: tcpdump -w FILE udp")


def _may_be_natnet(datagram: Datagram) -> bool:
    """Say whether a datagram is to be decoded: the only one of a file, or one that looks as if it were NatNet."""
    data = datagram.data
    if datagram.time_s < 0.0:
        return True
    if len(data) < HEADER_BYTES:
        return False
    message, size = int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little")
    return message in set(Message) and size == len(data) - HEADER_BYTES
