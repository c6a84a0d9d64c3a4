"""The settings of a bench session, kept beside its campaign so that it can be resumed. Imports nothing heavy."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import tomli_w

from agvbench.errors import FileError, FlagError, OneOf
from agvbench.labels import labels_given
from agvbench.running.supervision.limits import DEFAULT_SAFETY
from agvbench.text_files import read_toml

SETTINGS_FILE = "bench.toml"
ORDERS = ("interleaved", "blocked", "shuffled")
PLACES = ("auto", "operator", "teleport")
MAPS = ("default", "thesis")
STEERINGS = ("abeam", "front", "rear", "opposite", "crab")
"""Those of `agvbench.planning.trajectories.segments.Steering`, which takes longer to import."""
NAME_VALUE = "NAME=VALUE"
"""The metavar of options that are several options of a part of the rig, by name."""
_MOST_REPEATS = 1000
"""A thousand repeats of the shipped benchmarks take days; all runs are planned before the first is driven."""
_LARGEST_SEED = 2**63 - 1
# What may differ between a session and the one that resumes it: none of these changes what is driven.
_FREE_ON_RESUME = frozenset({"benchmarks", "only", "conditions", "connect", "bus_config", "lab", "exchange", "session"})
# A fault that was rehearsed may be taken away, or another one put in.
_MAY_HAVE_FAULTS = ("agv", "mocap", "camera")


def _option(default: Any, text: str, *, joined: bool = False, **keywords: Any) -> Any:
    """Return a field that is an option: its help, and what argparse and pytest declare it with."""
    return field(default=default, metadata={"help": text, "joined": joined, "keywords": keywords})


@dataclass(frozen=True)
class BenchSettings:
    """The options that decide what is driven.

    Every field but the last two is an option of ``agvbench bench``, and with the prefix ``--agvbench-`` one of pytest.
    An empty text is the usual value that the option's help names; ``repeats`` 0 is the number that each benchmark
    declares. ``benchmarks`` are names or files, and ``only`` selects runs of them by pytest's ``-k``.
    """

    agv: str = _option(
        "sim",
        "vehicle adapter: sim (default); live, in real time; serial:PORT; simavr, its firmware; FILE.py:ADDRESS",
        metavar="ADAPTER",
    )
    mocap: str = _option(
        "sim", "motion capture adapter: sim (default); natnet:HOST; natnet:emulated; FILE.py:ADDRESS", metavar="ADAPTER"
    )
    camera: str = _option(
        "",
        "an option of the camera, such as body=blue or rate_hz=240; several with commas, or one after another",
        metavar=NAME_VALUE,
        joined=True,
    )
    plant: str = _option(
        "agvbench.simulator:make_plant",
        "simulated plant, MODULE_OR_FILE:FACTORY (default: one of the vehicle's kind, like the thesis' or a robot)",
        metavar="PLANT",
    )
    plant_option: str = _option(
        "",
        "a parameter of the plant, such as understeer_s2_per_m2=0.05; several with commas, or one after another",
        metavar=NAME_VALUE,
        joined=True,
    )
    trajectories: str = _option(
        "",
        "names or .toml files, with commas or one after another (default: the eight, and your own in trajectories/)",
        metavar="NAME",
        joined=True,
    )
    conditions: str = _option(
        "",
        "conditions to drive, such as calibrated; several with commas, or one after another (default: all)",
        metavar="NAME",
        joined=True,
    )
    steering: str = _option(
        "",
        "steer every trajectory in this mode (default: as each says, or with the one axle that steers)",
        choices=STEERINGS,
    )
    vehicle: str = _option("", "vehicle.toml before calibration (default: nominal maps)", metavar="FILE")
    calibration: str = _option(
        "", "calibrated vehicle.toml, in place of driving the calibration in this session", metavar="FILE"
    )
    corrected: str = _option(
        "", "vehicle.toml with effects, for the condition corrected (default: not driven)", metavar="FILE"
    )
    remainders: str = _option(
        "", "end-pose bias of the corrected model, by trajectory (agvbench loop writes it)", metavar="FILE"
    )
    maps: str = _option("default", "maps to calibrate: default, or the thesis' line and cubic", choices=MAPS)
    repeats: int = _option(
        0,
        "repeats of each trajectory and condition (default: 10); calibration, step_response, free_driving and endurance"
        " declare a number of their own",
        metavar="N",
    )
    order: str = _option(
        "interleaved", "order of runs (default: interleaved; the thesis drove blocked)", choices=ORDERS
    )
    seed: int = _option(0, "seed of everything random (default: 0)", metavar="N")
    full: bool = _option(False, "every pulse, configuration and repeat of the thesis' calibration")
    attempts: int = _option(3, "attempts at a run that is rejected (default: 3)", metavar="N")
    place: str = _option(
        "",
        "how it gets to its start: auto (drives itself), operator (real: default), teleport (simulated: default)",
        choices=PLACES,
    )
    workspace: str = _option(
        "circle:6.1", "floor that the cameras see [m], such as circle:6.1 (default) or rectangle:7x5", metavar="SHAPE"
    )
    connect: str = _option(
        "", "where the adapters run, such as tcp/127.0.0.1:7447 (default: in process)", metavar="ENDPOINT"
    )
    bus_config: str = _option(
        "", "certificates and rules of a secured bus, as Zenoh writes them (default: none)", metavar="FILE"
    )
    exchange: float = _option(
        DEFAULT_SAFETY.control_cycle_s,
        "control cycle of a simulated vehicle: longer is sooner driven, later stopped (default: 0.1, as a real one)",
        metavar="S",
    )
    session: str = _option(
        "",
        "resumed after the vehicle was charged, re-mounted or trimmed: a new name for the runs from now on",
        metavar="NAME",
    )
    label: str = _option(
        "",
        "what to note of the circumstances, such as tyres=new; several with commas, or one after another",
        metavar=NAME_VALUE,
        joined=True,
    )
    lab: str = _option("lab", "name of the lab on the bus (default: lab)", metavar="NAME")
    vehicle_name: str = _option(
        "agv1", "name of the vehicle on the bus, and of its body (default: agv1)", metavar="NAME"
    )
    benchmarks: tuple[str, ...] = ()
    only: str = ""

    def __post_init__(self) -> None:
        repeats = f"1 to {_MOST_REPEATS}"
        _check(0 <= self.repeats <= _MOST_REPEATS, "--repeats", self.repeats, repeats, "give a whole number of repeats")
        _check(self.attempts >= 1, "--attempts", self.attempts, "at least 1", "give a whole number of attempts")
        _check(0 <= self.seed <= _LARGEST_SEED, "--seed", self.seed, f"0 to {_LARGEST_SEED}", "choose another seed")
        least = DEFAULT_SAFETY.watch_s
        _check(
            least <= self.exchange < math.inf,
            "--exchange",
            self.exchange,
            f"from {least:g} s",
            "leave it out",
        )
        labels_given(self.label)
        for option in fields(self):
            choices = option.metadata.get("keywords", {}).get("choices")
            if choices:
                value, allowed = getattr(self, option.name), (option.default, *choices)
                _check(value in allowed, f"--{option.name}", value, OneOf(choices), "choose one of these")

    @property
    def asked_conditions(self) -> tuple[str, ...]:
        """The conditions to drive; none for all."""
        return tuple(filter(None, (name.strip() for name in self.conditions.split(","))))

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


def _check(condition: bool, flag: str, value: object, limit: str | OneOf, remedy: str) -> None:
    if not condition:
        raise FlagError("value cannot be used", where=flag, value=value, limit=limit, remedy=remedy)
