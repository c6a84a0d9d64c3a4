"""The options of a bench session, for pytest and for the command line. Imports nothing heavy."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from typing import Any

PYTEST_PREFIX = "--agvbench-"
SHORT_NAMES = "--agvbench-short-names"
"""What ``agvbench bench`` hands to pytest, so that messages name options as its users do."""


class Joined(argparse.Action):
    """Keeps every value of an option that is given several times, with commas between."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        """Add a value to those before."""
        before = getattr(namespace, self.dest, None)
        setattr(namespace, self.dest, f"{before},{values}" if before else values)


def whole_number(text: str) -> int:
    """Return the whole number that an option says in the digits 0 to 9, without separators.

    Raises
    ------
    ArgumentTypeError
        If it says none.
    """
    if not re.fullmatch(r"[+-]?[0-9]{1,30}", text):
        raise argparse.ArgumentTypeError(f"not a whole number: {text!r}")
    return int(text)


def number(text: str) -> float:
    """Return the number that an option says, as `whole_number` with a point and an exponent, or nan or inf."""
    if not re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?|nan|[+-]?inf", text):
        raise argparse.ArgumentTypeError(f"not a number: {text!r}")
    return float(text)


# Not given is None everywhere, so that a resumed session can distinguish given options from defaults.
_FLAG: dict[str, Any] = {"action": "store_true", "default": None}
OPTIONS: tuple[tuple[str, dict[str, Any], str], ...] = (
    (
        "--agv",
        {"metavar": "ADAPTER"},
        "vehicle adapter: sim (default); live, in real time; serial:PORT; simavr, its firmware; FILE.py:ADDRESS",
    ),
    (
        "--mocap",
        {"metavar": "ADAPTER"},
        "motion capture adapter: sim (default); natnet:HOST; natnet:emulated; FILE.py:ADDRESS",
    ),
    (
        "--camera",
        {"metavar": "NAME=VALUE", "action": Joined},
        "an option of the camera, such as body=blue or rate_hz=240; several with commas, or one after another",
    ),
    (
        "--plant",
        {"metavar": "PLANT"},
        "simulated plant, MODULE_OR_FILE:FACTORY (default: a vehicle like the thesis')",
    ),
    (
        "--trajectories",
        {"metavar": "NAME", "action": Joined},
        "names or .toml files, with commas or one after another (default: the eight, and your own in trajectories/)",
    ),
    (
        "--steering",
        {"choices": ("abeam", "front", "rear", "opposite", "crab")},
        "steer every trajectory in this mode (default: as each says, or with the one axle that steers)",
    ),
    ("--vehicle", {"metavar": "FILE"}, "vehicle.toml before calibration (default: nominal maps)"),
    ("--calibration", {"metavar": "FILE"}, "calibrated vehicle.toml (default: calibrate in this session)"),
    (
        "--corrected",
        {"metavar": "FILE"},
        "vehicle.toml with effects, for the condition corrected (default: not driven)",
    ),
    (
        "--remainders",
        {"metavar": "FILE"},
        "end-pose bias of the corrected model, by trajectory (agvbench loop writes it)",
    ),
    ("--maps", {"choices": ("default", "thesis")}, "maps to calibrate: default, or the thesis' line and cubic"),
    ("--repeats", {"type": whole_number, "metavar": "N"}, "repeats of each trajectory and condition (default: 10)"),
    (
        "--order",
        {"choices": ("interleaved", "blocked", "shuffled")},
        "order of runs (default: interleaved; the thesis drove blocked)",
    ),
    ("--seed", {"type": whole_number, "metavar": "N"}, "seed of everything random (default: 0)"),
    ("--full", _FLAG, "every pulse, configuration and repeat of the thesis' calibration"),
    ("--attempts", {"type": whole_number, "metavar": "N"}, "attempts at a run that is rejected (default: 3)"),
    (
        "--place",
        {"choices": ("auto", "operator", "teleport")},
        "how it gets to its start: auto (drives itself), operator (real: default), teleport (simulated: default)",
    ),
    (
        "--workspace",
        {"metavar": "SHAPE"},
        "floor that the cameras see [m], such as circle:6.1 (default) or rectangle:7x5",
    ),
    (
        "--connect",
        {"metavar": "ENDPOINT"},
        "where the adapters run, such as tcp/127.0.0.1:7447 (default: in process)",
    ),
    (
        "--bus-config",
        {"metavar": "FILE"},
        "certificates and rules of a secured bus, as Zenoh writes them (default: none)",
    ),
    (
        "--exchange",
        {"type": number, "metavar": "S"},
        "control cycle of a simulated vehicle: longer is sooner driven, later stopped (default: 0.1, as a real one)",
    ),
    (
        "--session",
        {"metavar": "NAME"},
        "resumed after the vehicle was charged, re-mounted or trimmed: a new name for the runs from now on",
    ),
    ("--lab", {"metavar": "NAME"}, "name of the lab on the bus (default: lab)"),
    ("--vehicle-name", {"metavar": "NAME"}, "name of the vehicle on the bus, and of its body (default: agv1)"),
)
SESSION_OPTIONS: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("--out", {"metavar": "DIR"}, "campaign directory (default: a new one under campaigns/)"),
    ("--resume", _FLAG, "go on with an interrupted session: the one in --out, or the last"),
    ("--dry-run", _FLAG, "say what would be driven, for how long and on how much floor; drive nothing"),
    ("--no-report", _FLAG, "write the campaign only, no report"),
)
_NAMES = "|".join(re.escape(flag) for flag, _, _ in OPTIONS + SESSION_OPTIONS)
_OWN_OR_OTHERS = re.compile(rf"agvbench [a-z]+[^;,()]*|(?<![\w-])({_NAMES})(?![\w-])")


def add_options(add: Callable[..., Any], prefix: str = "--") -> None:
    """Declare every option with `add`, argparse's or pytest's way, under names that begin with `prefix`."""
    for flag, keywords, text in OPTIONS + SESSION_OPTIONS:
        add(prefixed(flag, prefix), help=text, **keywords)


def prefixed(flag: str, prefix: str = PYTEST_PREFIX) -> str:
    """Return an option's name in pytest, where options of all plugins and projects meet.

    >>> prefixed("--seed")
    '--agvbench-seed'
    """
    return prefix + flag.removeprefix("--")


def in_pytest(text: str) -> str:
    """Return a message with the options of ``agvbench bench`` under their names in pytest; other commands keep theirs.

    >>> in_pytest("--repeats: value cannot be used: -1")
    '--agvbench-repeats: value cannot be used: -1'
    >>> in_pytest("agvbench report DIR --out FILE writes it; go on with --resume --out c")
    'agvbench report DIR --out FILE writes it; go on with --agvbench-resume --agvbench-out c'
    """
    return _OWN_OR_OTHERS.sub(lambda found: prefixed(found[1]) if found[1] else found[0], text)


def destination(flag: str) -> str:
    """Return the attribute that an option's value is found under.

    >>> destination("--dry-run")
    'dry_run'
    """
    return flag.lstrip("-").replace("-", "_")
