"""Network faults to rehearse with: packets of an emulated server are lost, duplicated, reordered or truncated."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, fields

from agvbench.errors import FlagError, OneOf

_PREFIX = "packet_"


@dataclass(frozen=True)
class PacketFaults:
    """Shares of the packets with frames, 0 to 1; each is a camera option ``packet_NAME=SHARE``.

    ``lost`` never arrive, ``doubled`` arrive twice, ``reordered`` arrive after the next, of ``cut`` the second half is
    missing.
    """

    lost: float = 0.0
    doubled: float = 0.0
    reordered: float = 0.0
    cut: float = 0.0

    @classmethod
    def split(cls, camera: Mapping[str, str | float]) -> tuple[PacketFaults, dict[str, str | float]]:
        """Return the faults among the options of a camera, and the options that are left.

        >>> PacketFaults.split({"packet_lost": "0.1", "rate_hz": "60"})[1]
        {'rate_hz': '60'}

        Raises
        ------
        FlagError
            If there is no such fault, or its value is not a share.
        """
        rest = {name: value for name, value in camera.items() if not name.startswith(_PREFIX)}
        given = {name: _share(name, value) for name, value in camera.items() if name not in rest}
        return cls(**{name.removeprefix(_PREFIX): share for name, share in given.items()}), rest


def _share(name: str, value: str | float) -> float:
    known = [_PREFIX + field.name for field in fields(PacketFaults)]
    if name not in known:
        raise FlagError("no such fault of packets", where="--camera", value=name, limit=OneOf(known))
    try:
        share = float(value)
    except ValueError:
        share = -1.0
    if not 0.0 <= share <= 1.0:
        raise FlagError("not a share of the packets", where=f"--camera {name}", value=value, limit="0 to 1")
    return share


class Network:
    """Carries packets, as well as its faults let it; the same seed loses the same ones."""

    def __init__(self, faults: PacketFaults, seed: int = 0) -> None:
        self._faults, self._random = faults, random.Random(seed)  # noqa: S311  (faults, not secrets)
        self._reordered: list[bytes] = []

    def carry(self, packet: bytes) -> list[bytes]:
        """Return what arrives now that `packet` was sent.

        >>> Network(PacketFaults()).carry(b"frame"), Network(PacketFaults(lost=1.0)).carry(b"frame")
        ([b'frame'], [])
        """
        faults, chance = self._faults, self._random.random
        if chance() < faults.lost:
            return []
        if chance() < faults.cut:
            packet = packet[: len(packet) // 2]
        arriving = [packet] * (2 if chance() < faults.doubled else 1)
        if not self._reordered and chance() < faults.reordered:
            self._reordered = arriving
            return []
        late, self._reordered = self._reordered, []
        return arriving + late
