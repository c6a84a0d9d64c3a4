"""A place in a payload that only goes forward, and never behind its end."""

from __future__ import annotations

import struct
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import MessageError

_COUNT = struct.Struct("<i")
MAX_NAME_BYTES = 4096


class Cursor:
    """Reads little-endian fields one behind another; what is missing is a `MessageError`."""

    __slots__ = ("at", "payload")

    def __init__(self, payload: bytes, at: int = 0) -> None:
        self.payload, self.at = payload, at

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Return the fields that `layout` describes."""
        start = self.at
        self.at = start + layout.size
        if self.at > len(self.payload):
            self._cut_off(self.at)
        return layout.unpack_from(self.payload, start)

    def count(self) -> int:
        """Return a number of things (i32)."""
        count: int = self.take(_COUNT)[0]
        if count < 0:
            raise MessageError("NatNet packet with a negative count", where=f"byte {self.at - 4}", value=count)
        return count

    def skip(self, size: int) -> int:
        """Go on by `size` bytes; return where they begin."""
        start = self.at
        self.at = start + size
        if self.at > len(self.payload):
            self._cut_off(self.at)
        return start

    def rows(self, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return `count` records, read-only, without a copy."""
        return np.frombuffer(self.payload, dtype, count, self.skip(count * dtype.itemsize))

    def text(self) -> str:
        """Return a text that ends with a zero byte."""
        end = self.payload.find(b"\0", self.at, self.at + MAX_NAME_BYTES)
        if end < 0:
            raise MessageError("NatNet name has no end", where=f"byte {self.at}", limit=f"{MAX_NAME_BYTES} B")
        start, self.at = self.at, end + 1
        return self.payload[start:end].decode("utf-8", "replace")

    @property
    def left(self) -> int:
        """How many bytes are left."""
        return len(self.payload) - self.at

    def _cut_off(self, needed: int) -> NoReturn:
        raise MessageError("NatNet packet is cut off", value=f"{len(self.payload)} B", limit=f"at least {needed} B")
