"""Versions of the bit stream, and how each lays out a frame of data.

======= ==========================================================================================
from    what came or went
======= ==========================================================================================
2.1     skeletons
2.3     labelled markers
2.6     flags of bodies and of labelled markers; time stamp and flags of the frame, which 2.5 may have, too
2.7     time stamp in double instead of single precision
2.9     force plates
2.11    devices
3.0     no markers within bodies, no latency; ticks of the server's clock; residuals of labelled markers
4.1     assets; every section says its size; ticks in another, more precise form
======= ==========================================================================================
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from agvbench.errors import MessageError


class Version(NamedTuple):
    """Major and minor number, which compare as numbers: 2.11 is later than 2.9.

    >>> Version.parse("2.11") > Version.parse("2.9")
    True
    >>> str(Version(4, 1))
    '4.1'
    """

    major: int
    minor: int

    @classmethod
    def parse(cls, text: str) -> Version:
        """Return the version that a user wrote, as ``4.1``.

        Raises
        ------
        MessageError
            If it is not one, or not supported.
        """
        if not re.fullmatch(r"\d{1,3}\.\d{1,3}", text):
            raise MessageError("not a NatNet version", value=repr(text), remedy="write major.minor, as in 4.1")
        major, minor = map(int, text.split("."))
        return cls(major, minor).checked()

    def checked(self) -> Version:
        """Return the version itself, or raise `MessageError` if packets of it cannot be read."""
        if not OLDEST <= self < Version(NEWEST.major + 1, 0):
            raise MessageError("NatNet version is not supported", value=self, limit=f"{OLDEST} to {NEWEST}")
        return self

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"


OLDEST, NEWEST = Version(2, 5), Version(4, 2)
"""What packets were checked for; later minor versions are read as the newest, skipping what is not known."""


BODY = np.dtype(
    [("id", "<i4"), ("position_m", "<f4", 3), ("quaternion", "<f4", 4), ("mean_error_m", "<f4"), ("flags", "<i2")]
)
"""A rigid body: quaternion x y z w; bit 0 of the flags says that it is tracked."""
MARKER = np.dtype([("id", "<i4"), ("position_m", "<f4", 3), ("size_m", "<f4"), ("flags", "<i2"), ("residual_m", "<f4")])
"""A labelled marker: its id is the body's times 65536 plus its number, as a server sends it."""
TRACKED = 1


@dataclass(frozen=True)
class Layout:
    """What a frame of one version consists of."""

    sized: bool
    """Whether every section says how many bytes it has."""
    bodies_with_markers: bool
    body_flags: bool
    marker: np.dtype[Any]
    plates: int
    """How many kinds of analogue channels there are: force plates, devices."""
    tail: struct.Struct
    """What stands behind the sections, without the end tag."""
    tail_names: tuple[str, ...]


def _tail(version: Version) -> tuple[struct.Struct, tuple[str, ...]]:
    fields = [] if version >= (3, 0) else [("f", "latency_s")]
    fields += [("I", "timecode"), ("I", "timecode_sub"), ("d" if version >= (2, 7) else "f", "timestamp_s")]
    if version >= (3, 0):
        fields += [("Q", "exposed_ticks"), ("Q", "received_ticks"), ("Q", "transmitted_ticks")]
    if version >= (4, 1):
        fields += [("I", "precision_s"), ("I", "precision_fraction")]
    fields += [("h", "flags")]
    formats, names = zip(*fields, strict=True)
    return struct.Struct("<" + "".join(formats)), names


@lru_cache(maxsize=32)
def layout_of(version: Version) -> Layout:
    """Return the layout of a version's frames."""
    fields = ["id", "position_m", "size_m", *["flags"] * (version >= (2, 6)), *["residual_m"] * (version >= (3, 0))]
    tail, names = _tail(version)
    return Layout(
        sized=version >= (4, 1),
        bodies_with_markers=version < (3, 0),
        body_flags=version >= (2, 6),
        marker=np.dtype([(name, *MARKER.fields[name][:1]) for name in fields]),  # type: ignore[index]
        plates=(version >= (2, 9)) + (version >= (2, 11)),
        tail=tail,
        tail_names=names,
    )
