"""A captured stream as JSON lines, one for each packet, for people and for bug reports."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from agvbench.adapters.natnet.capture import Datagram, datagrams_of
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.description import decode_descriptions
from agvbench.adapters.natnet.protocol.frame import decode_frame
from agvbench.adapters.natnet.protocol.packet import HEADER_BYTES, Message, split
from agvbench.adapters.natnet.protocol.server_info import decode_server_info
from agvbench.errors import FileError, MessageError

_TICKS = struct.Struct("<Q")
_TEXTS = (Message.REQUEST, Message.RESPONSE, Message.MESSAGESTRING)
_BITSTREAM = "Bitstream,"
_MAX_TEXT = 1000


class Transcript:
    """Turns packets into dictionaries; remembers the version that was agreed on and what bodies are called.

    Parameters
    ----------
    version
        Of the bit stream; None to take it from the handshake.
    """

    def __init__(self, version: Version | None = None) -> None:
        self._given = version is not None
        self._version = version
        self._names: dict[int, str] = {}

    def decode(self, datagram: bytes) -> dict[str, Any]:
        """Return what a packet says: ``message``, and more by kind.

        Raises
        ------
        MessageError
            If it cannot be decoded, or its version is not known.
        """
        number, payload = split(datagram)
        if number not in set(Message):
            raise MessageError("not a NatNet message", value=number, limit="0 to 14, or 100")
        message = Message(number)
        line: dict[str, Any] = {"message": message.name}
        if message is Message.FRAMEOFDATA:
            line |= self._frame(payload)
        elif message is Message.MODELDEF:
            bodies = decode_descriptions(payload, self._agreed())
            self._names = {body.id: body.name for body in bodies}
            line["bodies"] = [body._asdict() for body in bodies]
        elif message is Message.SERVERINFO:
            line |= self._server(payload)
        elif message in _TEXTS:
            line |= self._text(message, payload)
        elif message in {Message.ECHO_REQUEST, Message.ECHO_RESPONSE}:
            line["ticks"] = [ticks for (ticks,) in _TICKS.iter_unpack(payload[: len(payload) // 8 * 8])]
        return line

    def _agreed(self) -> Version:
        if self._version is None:
            raise MessageError("the version of the stream is not known", remedy="say it: --natnet-version 4.1")
        return self._version

    def _frame(self, payload: bytes) -> dict[str, Any]:
        frame = decode_frame(payload, self._agreed())
        bodies = [
            {
                "id": int(body["id"]),
                **({"name": self._names[int(body["id"])]} if int(body["id"]) in self._names else {}),
                "position_m": [_number(value) for value in body["position_m"]],
                "quaternion": [_number(value) for value in body["quaternion"]],
                "tracked": bool(tracked),
                "mean_error_m": _number(body["mean_error_m"]),
            }
            for body, tracked in zip(frame.bodies, frame.tracked, strict=True)
        ]
        return {"frame": frame.number, "timestamp_s": _number(frame.timestamp_s), "bodies": bodies}

    def _server(self, payload: bytes) -> dict[str, Any]:
        info = decode_server_info(payload)
        if not self._given:
            self._version = info.version.checked()
        return {key: str(value) if key == "version" else value for key, value in info._asdict().items()}

    def _text(self, message: Message, payload: bytes) -> dict[str, Any]:
        text = payload.split(b"\0")[0].decode("utf-8", "replace")[:_MAX_TEXT]
        if message is Message.REQUEST and text.startswith(_BITSTREAM) and not self._given:
            # From here on the server streams in the version that was asked for.
            self._version = Version.parse(".".join(text.removeprefix(_BITSTREAM).split(".")[:2]))
        if message is Message.RESPONSE and len(payload) == 4:
            return {"data": payload.hex()}
        return {"text": text}


def _number(value: float | np.floating[Any]) -> float | None:
    """Return a number as JSON has it: single precision in the nine digits that it takes, no NaN."""
    if not np.isfinite(value):
        return None
    return float(f"{value:.9g}") if isinstance(value, np.float32) else float(value)


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
            line = transcript.decode(datagram.data)
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
