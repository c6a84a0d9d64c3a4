"""Captured packets as JSON lines, for people and for bug reports."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from agvbench.adapters.natnet.description import decode_descriptions
from agvbench.adapters.natnet.frame import decode_frame
from agvbench.adapters.natnet.packet import Message, split
from agvbench.adapters.natnet.server import decode_server_info
from agvbench.adapters.natnet.version import Version
from agvbench.errors import MessageError

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

    def told(self, datagram: bytes) -> dict[str, Any]:
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
