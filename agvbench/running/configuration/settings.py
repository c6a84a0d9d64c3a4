"""The settings of a bench session, kept beside its campaign so that it can be resumed."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args

import tomli_w

from agvbench.errors import FileError, FlagError
from agvbench.planning.trajectories.segments import Steering
from agvbench.running.supervision.limits import DEFAULT_SAFETY
from agvbench.text_files import read_toml

SETTINGS_FILE = "bench.toml"
ORDERS = ("interleaved", "blocked", "shuffled")
PLACES = ("auto", "operator", "teleport")
MAPS = ("default", "thesis")
_MOST_REPEATS = 1000
"""A thousand repeats of the shipped benchmarks take days; all runs are planned before the first is driven."""
_LARGEST_SEED = 2**63 - 1
# What may differ between a session and the one that resumes it: none of these changes what is driven.
_FREE_ON_RESUME = frozenset({"benchmarks", "only", "connect", "bus_config", "lab", "exchange", "session"})
# A fault that was rehearsed may be taken away, or another one put in.
_MAY_HAVE_FAULTS = ("agv", "mocap", "camera")


@dataclass(frozen=True)
class BenchSettings:
    """The options that decide what is driven.

    ``agv``, ``mocap`` and ``plant`` name adapters and the simulated plant, ``camera`` its options; ``vehicle`` and
    ``calibration`` are vehicle files ("" for the shipped nominal vehicle, and for calibrating in this session),
    ``corrected`` the one with the effects that a diagnosis found ("" for none: the condition is not driven) and
    ``remainders`` its end-pose bias; ``trajectories`` are names or files with commas between ("" for the
    eight and the lab's own); ``repeats`` 0 means what each benchmark declares; ``order`` is one of
    `ORDERS`; ``steering`` is the mode in which all trajectories are steered ("" for each its own); ``place``, one of
    `PLACES`, is how the vehicle comes to its starts ("" for the usual way); ``full`` drives every pulse of the thesis;
    ``exchange`` [s] is the control cycle of a simulated vehicle. ``vehicle_name`` is what the bus calls the
    vehicle, and ``session`` what the runs from now on belong to ("" for what the last belonged to); ``benchmarks`` are
    names or files, and ``only`` chooses among their runs by pytest's ``-k``.
    """

    agv: str = "sim"
    mocap: str = "sim"
    camera: str = ""
    plant: str = "agvbench.simulator:make_plant"
    steering: str = ""
    vehicle: str = ""
    calibration: str = ""
    corrected: str = ""
    remainders: str = ""
    trajectories: str = ""
    maps: str = "default"
    repeats: int = 0
    order: str = "interleaved"
    seed: int = 0
    full: bool = False
    attempts: int = 3
    place: str = ""
    workspace: str = "circle:6.1"
    connect: str = ""
    bus_config: str = ""
    lab: str = "lab"
    vehicle_name: str = "agv1"
    session: str = ""
    exchange: float = DEFAULT_SAFETY.control_cycle_s
    benchmarks: tuple[str, ...] = ()
    only: str = ""

    def __post_init__(self) -> None:
        repeats = f"1 to {_MOST_REPEATS}"
        _check(0 <= self.repeats <= _MOST_REPEATS, "--repeats", self.repeats, repeats, "give a whole number of repeats")
        _check(self.attempts >= 1, "--attempts", self.attempts, "at least 1", "give a whole number of attempts")
        _check(0 <= self.seed <= _LARGEST_SEED, "--seed", self.seed, f"0 to {_LARGEST_SEED}", "choose another seed")
        _check(self.order in ORDERS, "--order", self.order, ", ".join(ORDERS), "choose one of these")
        _check(self.place in ("", *PLACES), "--place", self.place, ", ".join(PLACES), "choose one of these")
        least = DEFAULT_SAFETY.watch_s
        _check(
            least <= self.exchange < math.inf,
            "--exchange",
            self.exchange,
            f"from {least:g} s",
            "leave it out",
        )
        modes = get_args(Steering)
        _check(self.steering in ("", *modes), "--steering", self.steering, ", ".join(modes), "choose one of these")
        _check(self.maps in MAPS, "--maps", self.maps, ", ".join(MAPS), "choose one of these")

    @classmethod
    def given(cls, options: Mapping[str, Any]) -> BenchSettings:
        """Return the settings that `options` ask for; what is not among them is as usual.

        Raises
        ------
        FlagError
            If a value cannot be used.
        """
        repeats = options.get("repeats", 1)
        _check(repeats >= 1, "--repeats", repeats, f"1 to {_MOST_REPEATS}", "give a whole number of repeats")
        known = {f.name for f in fields(cls)}
        return cls(**{name: value for name, value in options.items() if name in known})

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> BenchSettings:
        """Return the settings that a file holds.

        Raises
        ------
        TypeError
            If it has others.
        FlagError
            If a value cannot be used.
        """
        return cls(**{**table, "benchmarks": tuple(map(str, table.get("benchmarks", ())))})

    def save(self, directory: Path) -> None:
        """Write the settings beside the campaign's tables; what was there is replaced at once or not at all.

        Raises
        ------
        FileError
            If they cannot be written.
        """
        from agvbench.campaign.manifest import record

        path = directory / SETTINGS_FILE
        try:
            record(directory, {SETTINGS_FILE: tomli_w.dumps(asdict(self)).encode()})
        except OSError as error:
            raise FileError("cannot be written", where=path, value=error.strerror, remedy="free some space") from None

    @classmethod
    def load(cls, directory: Path) -> BenchSettings:
        """Read the settings of the campaign in `directory`.

        Raises
        ------
        FileError
            If they are missing or not what agvbench wrote.
        """
        return cls.read(directory / SETTINGS_FILE, "bench session")

    @classmethod
    def read(cls, path: Path, what: str) -> BenchSettings:
        """Read the settings in the file `path`; `what` they are of.

        Raises
        ------
        FileError
            If they are missing or not what agvbench wrote.
        """
        remedy = "start anew without --resume"
        try:
            return cls.from_table(read_toml(path))
        except FileNotFoundError:
            raise FileError(f"no {what} to resume", where=path, remedy=remedy) from None
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, TypeError) as error:
            raise FileError(f"not the settings of a {what}", where=path, value=error, remedy=remedy) from None


def settings_for_resume(saved: BenchSettings, given: Mapping[str, Any]) -> BenchSettings:
    """Return the saved settings, after checking that no option `given` on the command line contradicts them.

    Raises
    ------
    FlagError
        If an option differs from what the session began with.
    """
    known = {f.name for f in fields(BenchSettings)}
    BenchSettings.given(given)
    for name, value in given.items():
        if name not in known or name in _FREE_ON_RESUME:
            continue
        before = getattr(saved, name)
        if name in _MAY_HAVE_FAULTS and _without_faults(name, value) == _without_faults(name, before):
            continue
        if value != before:
            flag = f"--{name.replace('_', '-')}"
            raise FlagError(
                "a resumed session drives what it began with",
                where=flag,
                value=value,
                limit=before,
                remedy=f"leave {flag} out, or start anew without --resume",
            )
    free = {name: given[name] for name in (*_FREE_ON_RESUME, *_MAY_HAVE_FAULTS) if name in given}
    # What the first runs were called is not what the last were: that is read off the runs.
    return replace(saved, **{"session": "", **free})


def _without_faults(name: str, value: str) -> str:
    from agvbench.adapters.impairment.spec import unimpaired, without_packet_faults

    return without_packet_faults(value) if name == "camera" else unimpaired(value)


def _check(condition: bool, flag: str, value: object, limit: str, remedy: str) -> None:
    if not condition:
        raise FlagError("value cannot be used", where=flag, value=value, limit=limit, remedy=remedy)
