"""Which faults, how severe and when: ``impaired:NAME[=VALUE][@[RUN/]TIME]+…:ADAPTER``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from agvbench.errors import LinkError

SCHEME = "impaired"
_FORM = re.compile(r"(?P<name>[a-z_]+)(=(?P<value>-?\d+(\.\d+)?))?(@((?P<run>\d{1,9})/)?(?P<from_s>-?\d+(\.\d+)?))?")
_REMEDY = f"write {SCHEME}:NAME[=VALUE][@[RUN/]TIME]:ADAPTER, several faults with + between them"


@dataclass(frozen=True)
class Impairment:
    """One fault: its name, its severity (None: the default), and when it begins.

    ``run`` counts the runs of an adapter from 1, None is every run; ``from_s`` [s] is in the run's clock.
    """

    name: str
    value: float | None = None
    run: int | None = None
    from_s: float = -math.inf

    @classmethod
    def parse(cls, text: str) -> Impairment:
        """Return what `text` says.

        >>> Impairment.parse("lost=0.1"), Impairment.parse("frozen@2/0.6").run
        (Impairment(name='lost', value=0.1, run=None, from_s=-inf), 2)

        Raises
        ------
        LinkError
            If it is not of that form.
        """
        found = _FORM.fullmatch(text)
        if found is None:
            raise LinkError("not a fault", where=SCHEME, value=repr(text), remedy=_REMEDY)
        value, run, from_s = found["value"], found["run"], found["from_s"]
        return cls(
            found["name"],
            None if value is None else float(value),
            None if run is None else int(run),
            -math.inf if from_s is None else float(from_s),
        )

    def holds(self, run: int, t_s: float) -> bool:
        """Return whether it holds at `t_s` [s] of run number `run`."""
        return (self.run is None or self.run == run) and t_s >= self.from_s - 1e-9


def parse_address(address: str) -> tuple[list[Impairment], str]:
    """Return the faults and the adapter that they are injected into.

    >>> [fault.name for fault in parse_address("lost=0.1+late:natnet:emulated")[0]]
    ['lost', 'late']

    Raises
    ------
    LinkError
        If one of them is missing, or not of its form.
    """
    faults, colon, adapter = address.partition(":")
    if not colon or not adapter:
        raise LinkError("which adapter is impaired?", where=SCHEME, value=repr(address), remedy=_REMEDY)
    return [Impairment.parse(text) for text in faults.split("+")], adapter


def without_packet_faults(camera: str) -> str:
    """Return the camera options without those of a bad network.

    >>> without_packet_faults("packet_lost=0.1,rate_hz=60")
    'rate_hz=60'
    """
    return ",".join(option for option in camera.split(",") if not option.startswith("packet_"))


def unimpaired(spec: str) -> str:
    """Return the adapter specification without its faults.

    >>> unimpaired("impaired:lost=0.1:natnet:emulated"), unimpaired("sim")
    ('natnet:emulated', 'sim')
    """
    while spec.startswith(f"{SCHEME}:"):
        spec = spec.split(":", 2)[-1]
    return spec
