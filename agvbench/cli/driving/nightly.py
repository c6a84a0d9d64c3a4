"""Drive a night: bench, diagnose, compare with the last good night, and show the history of all nights.

The night is the campaign NIGHTS/DATE. It is driven with the calibration of the last good night, if there is one, and
compared with that night. If nothing failed, it is added to the good nights (NIGHTS/good_nights.txt). Called again on
the same day, the command continues an interrupted night. Options are those of agvbench bench, but for those that a
night sets itself: directory, resumption and comparison.

A file gate.toml beside you, or another one with --gate, limits statistics of metrics: see agvbench compare --help.

examples:
  agvbench nightly                          simulated, with 10 repeats of each trajectory
  agvbench nightly --repeats 5 --nights n   fewer repeats, into the directory n/
  agvbench nightly --agv serial:/dev/ttyACM0 --mocap natnet:192.168.1.5 --vehicle vehicle.toml
                                            on hardware

exit codes: 0 nothing failed; 1 a run failed, or the comparison shows a regression, or a rule failed; 2 bad input or
set-up; 3 the comparison is not decided.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

HELP = "drive a night, diagnose it, compare it with the last good one, show the history"
PACKAGES = ("numba", "zenoh")
_GOOD = "good_nights.txt"
_GATE = Path("gate.toml")
_DRIVEN = (0, 1)
"""Exit codes of a bench whose campaign can be judged; 1: some run failed."""
_PASSED = {"diagnose": (0, 2)}
"""Exit codes that do not fail the night, where they are not 0 alone; 2: the campaign is too small for a diagnosis."""
_SIGNALLED = 128
"""Exit codes from here on are those of steps that a signal ended."""
_SET_HERE = frozenset({"--out", "--resume", "--dry-run", "--against", "--until", "--fail-on", "--no-report"})
"""Options of a bench that a night sets itself, or that it has no use for."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from agvbench.running.configuration.session_options import add_options

    parser.add_argument("benchmarks", nargs="*", metavar="BENCHMARK", help="as in agvbench bench")
    parser.add_argument("-k", dest="only", metavar="EXPRESSION", help="only benchmarks whose names match, as in pytest")
    parser.add_argument("--nights", metavar="DIR", type=Path, default=Path("nightly"), help="all nights (nightly/)")
    parser.add_argument("--date", metavar="NAME", help="name of the night (default: the date, such as 2026-11-25)")

    def add(flag: str, **keywords: Any) -> None:
        if flag not in _SET_HERE:
            parser.add_argument(flag, **keywords)

    add_options(add)


def run(arguments: argparse.Namespace) -> int:
    """Drive and judge the night; return the exit code of the first step that failed, or 0."""
    import time

    from agvbench.cli._option_values import check_values
    from agvbench.errors import FlagError
    from agvbench.reporting.console.tables import wide_console
    from agvbench.workflows.comparison.decision import FailurePolicy

    check_values(vars(arguments))
    if arguments.date is not None and not _is_name(arguments.date):
        raise FlagError("is no name of a directory", where="--date", value=repr(arguments.date), limit="without /")
    gate = _gate(arguments)
    FailurePolicy.parse([], gate)  # a mistake in it is said before an evening is driven
    console = wide_console()
    night = arguments.nights / (arguments.date or time.strftime("%F"))
    good = last_good(arguments.nights, night.name)
    codes = {"bench": _bench(arguments, night, good)}
    if codes["bench"] in _DRIVEN:
        codes |= _judged(arguments, night, good, gate)
    failed = next((code for step, code in codes.items() if code not in _PASSED.get(step, (0,))), 0)
    if not failed:
        _keep(arguments.nights, night.name)
    _summarise(console, codes, night, good, is_good=not failed)
    return failed


def last_good(nights: Path, tonight: str) -> Path | None:
    """Return the newest good night before tonight's; None if there is none.

    Raises
    ------
    FileError
        If the file that names it cannot be read, or names no campaign of `nights`.
    """
    from agvbench.errors import FileError

    names = [name for name in _good_nights(nights) if name != tonight]
    if not names:
        return None
    if not _is_name(names[-1]) or not (nights / names[-1] / "campaign.toml").is_file():
        remedy = f"remove the line, or the file: the last line is the name of a campaign in {nights}/"
        raise FileError("names no campaign", where=nights / _GOOD, value=names[-1], remedy=remedy)
    return nights / names[-1]


def _is_name(text: str) -> bool:
    """Return whether a text can be the name of a directory, and no path out of the one that it lies in."""
    return bool(text.strip()) and text != ".." and Path(text).name == text


def _good_nights(nights: Path) -> list[str]:
    from agvbench.text_files import read_text

    file = nights / _GOOD
    return [name for name in read_text(file).splitlines() if name.strip()] if file.exists() else []


def _bench(arguments: argparse.Namespace, night: Path, good: Path | None) -> int:
    from agvbench.running.configuration.campaign_directory import has_session
    from agvbench.workflows.bench import DEFAULT, run_benchmarks

    options = vars(arguments) | {
        "out": str(night),
        "resume": has_session(night) or None,
        "gate": None,
        "margin_mm": None,
        "margin_deg": None,
        "no_report": True,
    }
    calibrated = good / "vehicle.toml" if good else None
    if calibrated is not None and calibrated.is_file() and arguments.calibration is None:
        options["calibration"] = str(calibrated)
    # A diagnosis needs the calibration runs of the night, too, whichever calibration its plans use. What is resumed
    # drives what it began with.
    benchmarks = arguments.benchmarks or (() if options["resume"] else DEFAULT)
    return run_benchmarks(benchmarks, options, only=arguments.only)


def _judged(arguments: argparse.Namespace, night: Path, good: Path | None, gate: Path | None) -> dict[str, int]:
    """Return the exit code of each step that follows the bench; an interruption ends all."""
    from agvbench.cli import main
    from agvbench.workflows.comparison.kept import JSON as COMPARISON

    files = night / "report"
    steps = {"diagnose": ["diagnose", str(night), "--json", str(night / "diagnosis.json")]}
    if good is not None:
        written = ["--junit", str(files / "compare.xml"), "--markdown", str(files / "compare.md")]
        written += ["--json", str(night / COMPARISON)]  # the report says what it found
        steps["compare"] = ["compare", str(good), str(night), *_limits(arguments, gate), *written]
    steps |= {"report": ["report", str(night)], "history": ["history", str(arguments.nights)]}
    codes: dict[str, int] = {}
    for step, command in steps.items():
        codes[step] = main(command)
        if codes[step] >= _SIGNALLED:
            break
    return codes


def _gate(arguments: argparse.Namespace) -> Path | None:
    return Path(arguments.gate) if arguments.gate else _GATE if _GATE.exists() else None


def _limits(arguments: argparse.Namespace, gate: Path | None) -> list[str]:
    """Return the options of the comparison: margins, and a gate beside the verdicts where there is one."""
    from agvbench.running.configuration.session_options import as_flag

    given = ["--fail-on", "regression", "--gate", str(gate)] if gate else []
    return [*given, *as_flag("--margin-mm", arguments.margin_mm), *as_flag("--margin-deg", arguments.margin_deg)]


def _keep(nights: Path, name: str) -> None:
    """Add the name to those of the good nights; that it was there already, of a night judged again, does no harm."""
    from agvbench.workflows.output_files import write_file

    text = "".join(f"{one}\n" for one in dict.fromkeys([*_good_nights(nights), name]))
    write_file("--nights", nights / _GOOD, lambda file: file.write_text(text, encoding="utf-8"))


def _summarise(console: Console, codes: dict[str, int], night: Path, good: Path | None, *, is_good: bool) -> None:
    """Print each step with its exit code, and what the night was compared with."""
    from rich.table import Table

    table = Table("step", "exit code", title=f"night {night}", title_justify="left")
    for step, code in codes.items():
        table.add_row(step, str(code))
    console.print(table)
    against = f"compared with {good}" if good else "the first night: compared with none"
    state = "the last good night now" if is_good else "not a good night; the reference stays"
    console.print(f"{against}; {state}", highlight=False, markup=False, soft_wrap=True)
