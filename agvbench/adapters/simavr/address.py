"""What stands behind ``simavr:``: a version of the firmware, and where in a servo frame a run begins."""

from __future__ import annotations

from typing import NamedTuple, Self

from agvbench.adapters.simavr.firmware_files import VERSIONS
from agvbench.errors import LinkError, OneOf

FRAME_S = 0.02
"""How often servo pulses come."""
_PHASE = "phase_ms="


class FirmwareAddress(NamedTuple):
    """``VERSION[,phase_ms=MS]``.

    Parameters
    ----------
    version
        Of the firmware, ``"1"`` or ``"2"``.
    phase_s
        How long [s] a run waits after the vehicle's reset, 0 to one frame; None: drawn anew for each run.
    """

    version: str = VERSIONS[-1]
    phase_s: float | None = None

    @classmethod
    def parse(cls, address: str, *, where: str) -> Self:
        """Return what `address` says; each part may be missing.

        >>> FirmwareAddress.parse("1,phase_ms=7.5", where="simavr"), FirmwareAddress.parse("", where="simavr")
        (FirmwareAddress(version='1', phase_s=0.0075), FirmwareAddress(version='2', phase_s=None))

        Raises
        ------
        LinkError
            If there is no such firmware, option or phase.
        """
        version, phase_s = VERSIONS[-1], None
        for part in filter(None, address.split(",")):
            if part.startswith(_PHASE):
                phase_s = _phase_s(part, where)
            elif part in VERSIONS:
                version = part
            else:
                raise LinkError(
                    "no such firmware", where=where, value=repr(part), limit=OneOf(VERSIONS),
                    remedy=f"write {where}:2 or {where}:2,{_PHASE}0",
                )  # fmt: skip
        return cls(version, phase_s)


def _phase_s(part: str, where: str) -> float:
    try:
        phase_s = float(part.removeprefix(_PHASE)) / 1e3
    except ValueError:
        phase_s = -1.0
    if not 0.0 <= phase_s < FRAME_S:
        raise LinkError(
            "no such phase of the servo frame", where=where, value=part, limit=f"0 to below {1e3 * FRAME_S:g} ms"
        )
    return phase_s
