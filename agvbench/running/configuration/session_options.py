"""The options of a bench session, for pytest and for the command line. Imports nothing heavy."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import Field, fields
from typing import Any

from agvbench.running.configuration.option_types import number, whole_number
from agvbench.running.configuration.settings import BenchSettings

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


# Not given is None everywhere, so that a resumed session can distinguish given options from defaults.
_FLAG: dict[str, Any] = {"action": "store_true", "default": None}
_BY_TYPE: dict[str, dict[str, Any]] = {
    "str": {},
    "bool": _FLAG,
    "int": {"type": whole_number},
    "float": {"type": number},
}


def _declared(option: Field[Any]) -> tuple[str, dict[str, Any], str]:
    """Return flag, keywords and help of a field of the settings."""
    joined = {"action": Joined} if option.metadata["joined"] else {}
    keywords = _BY_TYPE[str(option.type)] | joined | option.metadata["keywords"]
    return f"--{option.name.replace('_', '-')}", keywords, option.metadata["help"]


OPTIONS = tuple(_declared(option) for option in fields(BenchSettings) if option.metadata)
SESSION_OPTIONS: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("--out", {"metavar": "DIR"}, "campaign directory (default: a new one under campaigns/)"),
    ("--resume", _FLAG, "go on with an interrupted session: the one in --out, or the last"),
    ("--dry-run", _FLAG, "say what would be driven, for how long and on how much floor; drive nothing"),
    ("--no-report", _FLAG, "write the campaign only, no report"),
    ("--live", _FLAG, "show the bench in a Rerun viewer, in a process of its own"),
    (
        "--viewer",
        {"metavar": "URL"},
        "as --live, in a viewer that already runs, such as rerun+http://127.0.0.1:9876/proxy",
    ),
    (
        "--against",
        {"metavar": "DIR"},
        "compare with this campaign at the end, as agvbench compare does, and end with its exit code",
    ),
    (
        "--until",
        {"choices": ("decided",)},
        "decided: stop as soon as the comparison with --against is decided; --repeats is then the most repeats",
    ),
    ("--margin-mm", {"metavar": "MM", "type": number}, "noise band of the end position error (default: 5)"),
    ("--margin-deg", {"metavar": "DEG", "type": number}, "noise band of the heading error (default: 1)"),
    (
        "--fail-on",
        {"metavar": "RULE", "action": Joined},
        "with --against, when to exit with 1: regression (default), any, never, METRIC.STATISTIC>LIMIT; commas between",
    ),
    ("--gate", {"metavar": "FILE"}, "with --against, a TOML file of such rules"),
    (
        "--listen",
        {"metavar": "ENDPOINT"},
        "let agvbench watch join here, such as tcp/127.0.0.1:7447 (default: no socket is opened)",
    ),
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


def as_flag(flag: str, value: Any, prefix: str = "--") -> list[str]:
    """Return an option with its value as a command line has it; nothing of None and False.

    >>> as_flag("--seed", 3), as_flag("--full", True), as_flag("--full", False)
    (['--seed=3'], ['--full'], [])
    """
    if value is None or value is False:
        return []
    name = prefixed(flag, prefix)
    return [name] if value is True else [f"{name}={value}"]


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
