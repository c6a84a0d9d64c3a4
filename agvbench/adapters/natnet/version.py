"""Versions of the bit stream: what a packet looks like hangs on them, and packets do not say."""

from __future__ import annotations

import re
from typing import NamedTuple

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
