"""Key expressions: where on the bus each message travels.

::

    agvbench/v2/<lab>/<vehicle>/agv/command      commands, to the AGV adapter
                               /agv/<question>   queryables: identity, claim, release, reset, replay, time
                               /mocap/<question> queryables: identity, reset, time
                               /report           all that is for the runner: frames, and what an adapter has to say
                               /truth            true poses, from a simulated AGV to a simulated camera
                               /runner/state     the runner's state, published and queryable, to observers
                               /alive/<role>     liveliness tokens: agv, mocap
                               /alive/runner/<source>   and of every runner, by the source of its commands

``v2`` is the version of this layout; the messages carry the version of their own encoding. What a runner waits for
is one key and no wildcard: Zenoh takes a twentieth longer over a message that a wildcard has to be matched with.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from agvbench.errors import LinkError

AGV, MOCAP, RUNNER = "agv", "mocap", "runner"
IDENTITY, RESET, REPLAY, TIME = "identity", "reset", "replay", "time"
CLAIM, RELEASE = "claim", "release"

_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}", re.ASCII)


def state_keys(lab: str | None, vehicle: str | None) -> str:
    """Return the key expression of the states of all runners, or those of one lab or vehicle.

    >>> state_keys(None, "agv1")
    'agvbench/v2/*/agv1/runner/state'
    """
    names = (("lab", lab), ("vehicle", vehicle))
    return "/".join(["agvbench/v2", *("*" if n is None else check_name(w, n) for w, n in names), f"{RUNNER}/state"])


def of_state(key: str) -> Keys:
    """Return the keys of the vehicle whose runner's state is at `key`.

    >>> of_state("agvbench/v2/lab/agv1/runner/state")
    Keys(lab='lab', vehicle='agv1')
    """
    return Keys(*key.split("/")[2:4])


def check_name(what: str, name: str) -> str:
    """Return `name` if it can be one chunk of a key expression.

    >>> check_name("vehicle", "agv1")
    'agv1'
    >>> check_name("vehicle", "a/b")
    Traceback (most recent call last):
    agvbench.errors.LinkError: vehicle: name cannot be used on the bus: 'a/b' (limit: 1 to 64 of A-Z a-z 0-9 _ . -)
    """
    if not _NAME.fullmatch(name):
        raise LinkError(
            "name cannot be used on the bus", where=what, value=repr(name), limit="1 to 64 of A-Z a-z 0-9 _ . -"
        )
    return name


@dataclass(frozen=True)
class Keys:
    """The key expressions of one vehicle in one lab.

    >>> Keys("lab", "agv1").command
    'agvbench/v2/lab/agv1/agv/command'

    Raises
    ------
    LinkError
        If a name holds anything but letters, digits, ``_``, ``.`` and ``-``.
    """

    lab: str
    vehicle: str

    def __post_init__(self) -> None:
        check_name("lab", self.lab)
        check_name("vehicle", self.vehicle)

    @property
    def root(self) -> str:
        """What every key of this vehicle begins with."""
        return f"agvbench/v2/{self.lab}/{self.vehicle}"

    @property
    def command(self) -> str:
        """Commands, to the AGV adapter."""
        return f"{self.root}/agv/command"

    @property
    def report(self) -> str:
        """Everything that travels to the runner: frames and events, distinguished by their type."""
        return f"{self.root}/report"

    @property
    def truth(self) -> str:
        """True poses, from a simulated AGV to a simulated camera."""
        return f"{self.root}/truth"

    @property
    def state(self) -> str:
        """The runner's state, to observers."""
        return f"{self.root}/{RUNNER}/state"

    def queryable(self, role: str, queryable: str) -> str:
        """Return the queryable of an adapter (``"*"``: all of them)."""
        return f"{self.root}/{role}/{queryable}"

    def alive(self, role: str) -> str:
        """Return the liveliness token of an adapter or runner (``"*"``: all of them)."""
        return f"{self.root}/alive/{role}"

    def runner(self, source: int | None = None) -> str:
        """Return the liveliness token of the runner whose commands are of `source` (None: all of them)."""
        return self.alive(f"{RUNNER}/*" if source is None else f"{RUNNER}/{source:08x}")
