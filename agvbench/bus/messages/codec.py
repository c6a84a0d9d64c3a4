"""The encoding of all messages: MessagePack, an array of the encoding's version and a map with the message's fields.

The field ``type`` of the map says which message it is. A receiver refuses whatever it would not have written itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from agvbench.errors import MessageError, OneOf

VERSION = 6
ENCODING = "application/msgpack"
"""The encoding that Zenoh carries beside every payload."""
MAX_ROWS = 8192
MAX_TEXT = 4096
MAX_MESSAGE_BYTES = 1 << 20
_MAX_QUOTED = 200
_BEFORE_4 = b"AGVB"

Text = Annotated[str, Meta(max_length=MAX_TEXT)]
Source = Annotated[int, Meta(ge=0, le=0xFFFF_FFFF)]
"""Drawn by a sender when it starts, so that a restart is not mistaken for a loss."""
Number = Annotated[int, Meta(ge=0)]
"""Counts a sender's messages on one key: 1, 2, 3, …"""


class Message(msgspec.Struct, frozen=True, tag_field="type", forbid_unknown_fields=True):
    """What travels on the bus; a subclass names its ``type`` and checks the ranges of its fields.

    Numpy arrays travel as little-endian float64, row by row, in one binary field. They are received flat and read-only,
    as views of the bytes that msgspec copied out of the payload.
    """


class _Unknown(Message, tag="", frozen=True):
    """Stands beside one kind, since msgspec asks for the ``type`` only where there are two."""

    def __post_init__(self) -> None:
        raise MessageError("message of no kind")


class _Head(msgspec.Struct, array_like=True):
    version: int
    body: msgspec.Raw = msgspec.Raw()


class _Body(msgspec.Struct):
    type: str


_Version = Literal[6]
_Message = TypeVar("_Message", bound=Message)
_MALFORMED = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)


def _plain(value: object) -> object:
    """Return what msgspec can encode of Numpy's: arrays as bytes, scalars as plain numbers."""
    if not isinstance(value, (np.ndarray, np.generic)):
        raise MessageError("value cannot be sent", value=type(value).__name__, limit="numbers, texts and Numpy arrays")
    return np.ascontiguousarray(value, "<f8").tobytes() if value.ndim else value.item()


_encode = msgspec.msgpack.Encoder(enc_hook=_plain).encode
_head = msgspec.msgpack.Decoder(_Head).decode
_body = msgspec.msgpack.Decoder(_Body).decode


def encode(message: Message) -> bytes:
    """Return the message's bytes.

    Raises
    ------
    MessageError
        If a text holds what is no character, or a field what no message has.
    """
    try:
        return _encode((VERSION, message))
    except UnicodeEncodeError as error:
        raise MessageError(
            "text cannot be sent", where=type(message).__name__, value=repr(error.object[:_MAX_QUOTED]),
            limit="Unicode characters", remedy="rename what it names",
        ) from None  # fmt: skip


def decoder(*kinds: type[_Message]) -> Callable[[bytes], _Message]:
    """Return the function that decodes messages of these kinds, or raises `MessageError`."""
    layout: Any = tuple[_Version, reduce(or_, kinds, _Unknown)]  # type: ignore[misc]
    decode: Callable[[bytes], tuple[int, _Message]] = msgspec.msgpack.Decoder(layout, dec_hook=_array).decode
    names = " or ".join(str(kind.__struct_config__.tag) for kind in kinds)

    def decoded(payload: bytes) -> _Message:
        if len(payload) > MAX_MESSAGE_BYTES:
            raise MessageError("message is too long", value=f"{len(payload)} B", limit=f"at most {MAX_MESSAGE_BYTES} B")
        try:
            return decode(payload)[1]
        except _MALFORMED as error:
            raise _refusal(payload, names, error) from None

    return decoded


def _array(_: object, data: Any) -> Any:
    return np.frombuffer(data, "<f8")


def _refusal(payload: bytes, names: str, error: Exception) -> MessageError:
    """Return what is wrong with a message of at most `MAX_MESSAGE_BYTES` that was not decoded."""
    version, kind = _version_and_kind(payload)
    if version not in (None, VERSION):
        return MessageError(
            "message of another encoding", value=version, limit=VERSION, remedy="install the same agvbench on both ends"
        )
    if kind is not None and kind not in names.split(" or "):
        return MessageError("message of another kind", value=repr(kind[:_MAX_QUOTED]), limit=OneOf(names.split(" or ")))
    return MessageError(
        f"{names} message cannot be decoded",
        value=str(error).replace("`", "'")[:_MAX_QUOTED],
        limit=f"its layout in encoding {VERSION}",
        remedy="send what docs/reference/bus.md says",
    )


def _version_and_kind(payload: bytes) -> tuple[int | None, str | None]:
    """Return what a message says of itself, None where that cannot be read."""
    if payload.startswith(_BEFORE_4):
        return next(iter(payload[len(_BEFORE_4) :]), None), None
    version = None
    try:
        head = _head(payload)
        version = head.version
        return version, _body(head.body).type
    except _MALFORMED:
        return version, None
