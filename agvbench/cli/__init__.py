"""The command line: one file per command in the packages of this one, found by name.

A command is a module with ``HELP`` (one line), ``add_arguments(parser)`` and ``run(arguments) -> int``; ``PACKAGES``
lists what it needs that the light installation leaves out. It imports nothing heavy at module level, so that ``agvbench
--help`` stays instant; a module whose name starts with an underscore is not a command. Every user error ends as one
line on standard error and exit code 2.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from agvbench import __version__
from agvbench.cli import analysis, driving, laboratory
from agvbench.cli._failures import EXIT_CODE, Interrupts
from agvbench.errors import AgvbenchError, FlagError

_DESCRIPTION = "Does the vehicle do what is commanded, what does calibration buy, and what does the model lack?"
_PIPE_CLOSED = 128 + 13
"""As shells know it of a program that SIGPIPE ended: neither a success nor the answer "no"."""
_NAME_WIDTH, _HELP_WIDTH = 11, 79
_EPILOG = """\
exit codes: 0 done; 1 the answer is "no" (compare: a regression,
diagnose --check: not adequate, bench: a run failed, doctor: not ready,
mocap --check, agv --check: the adapter breaks its contract);
130, 143, 129 ended by Ctrl-C, SIGTERM, SIGHUP, the vehicle stopped first;
141 the reader of the output has gone (head);
2 bad input or set-up, with one line that says what to do;
3 inconclusive (compare: a campaign is incomplete or not comparable);
70 a mistake of agvbench itself, with the file to report.
shell completion: eval "$(register-python-argcomplete agvbench)"
"""


_GROUPS = (driving, analysis, laboratory)
"""The packages of commands, as ``agvbench --help`` lists them."""

# Our matrices have a hundred rows: more threads only wait for one another, and add up in another order.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def _modules_in(group: ModuleType) -> dict[str, str]:
    """Return the full name of the module of each command in a package."""
    # Not by pkgutil, which imports inspect: that takes as long as all modules of commands.
    modules = sorted(file.stem for file in Path(group.__path__[0]).glob("[!_]*.py"))
    return {name.removesuffix("_"): f"{group.__name__}.{name}" for name in modules}


def _command_names() -> dict[str, str]:
    """Return the module of each command, by group."""
    return {name: module for group in _GROUPS for name, module in _modules_in(group).items()}


def _imported(names: Mapping[str, str]) -> dict[str, ModuleType]:
    return {name: importlib.import_module(module) for name, module in names.items()}


def _listed() -> str:
    """Return what each command is for, under the titles of their groups."""
    lines, commands = [], _imported(_command_names())
    for group in _GROUPS:
        lines += ["", f"{str(group.__doc__).rstrip('.')}:"]
        for name in _modules_in(group):
            first, further = f"  {name:<{_NAME_WIDTH}}", " " * (_NAME_WIDTH + 2)
            lines += textwrap.wrap(commands[name].HELP, _HELP_WIDTH, initial_indent=first, subsequent_indent=further)
    return "\n".join(lines)


class _Parser(argparse.ArgumentParser):
    """Says what is wrong as every other error is said, without the usage."""

    def error(self, message: str) -> NoReturn:
        raise FlagError(message, remedy=f"see {self.prog} --help")


def build_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of ``agvbench`` with every command of this package, or, in less time, with one only."""
    names = _command_names()
    commands = _imported(names if command is None else {command: names[command]})
    parser = _program(_listed() if command is None else "")
    subparsers = _subparsers(parser)
    for name, module in commands.items():
        sub = subparsers.add_parser(
            name,
            allow_abbrev=False,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def _program(listed: str) -> argparse.ArgumentParser:
    """Return the parser of ``agvbench`` itself, whose help has the commands as they are `listed`."""
    parser = _Parser(
        prog="agvbench",
        description=f"{_DESCRIPTION}\n{listed}",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"agvbench {__version__}")
    return parser


def _subparsers(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser]:
    text = "one of these; agvbench COMMAND --help explains it"
    return parser.add_subparsers(dest="command", metavar="COMMAND", required=True, help=text)


def _require_packages(command: str) -> None:
    """Refuse a command whose packages the light installation leaves out.

    Raises
    ------
    FlagError
        If one is missing.
    """
    import importlib.util

    module = importlib.import_module(_command_names()[command])
    missing = [name for name in getattr(module, "PACKAGES", ()) if importlib.util.find_spec(name) is None]
    if missing:
        value = f"missing: {', '.join(missing)}"
        raise FlagError("needs more than the light installation", value=value, remedy="install agvbench as a whole")


def _unknown_option(parser: argparse.ArgumentParser, command: str, given: str) -> FlagError:
    """Return what to say of an argument that the command does not have, with the nearest that it has."""
    if not given.startswith("-"):
        return FlagError("one argument too many", value=given, remedy=f"see agvbench {command} --help")
    subparsers = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    known = [option for action in subparsers.choices[command]._actions for option in action.option_strings]
    meant = _meant(given.partition("=")[0], known)
    return FlagError("no such option", value=given, remedy=f"{meant}agvbench {command} --help lists all")


def _require_utf_8(given: Sequence[str]) -> None:
    """Refuse an argument of other bytes: tables, which keep names, hold UTF-8 only.

    Raises
    ------
    FlagError
        If there is one.
    """
    for argument in given:
        if not argument.isascii() and any("\udc80" <= character <= "\udcff" for character in argument):
            raise FlagError("argument is not UTF-8", value=repr(argument), remedy="rename the file or directory")


def _meant(given: str, known: Iterable[str]) -> str:
    """Return the question whether the nearest of those `known` was meant, or "" if none is near."""
    import difflib

    close = difflib.get_close_matches(given, list(known), n=1)
    return f"did you mean {close[0]}? " if close else ""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    for name in _ONE_THREAD:
        os.environ.setdefault(name, "1")  # read when numpy is imported, which no command has done yet
    given = sys.argv[1:] if argv is None else argv
    program = f"agvbench {given[0]}" if given and given[0] in _command_names() else "agvbench"
    with Interrupts() as interrupts:
        try:
            code = _run(given)
            if not interrupts.pressed or code in (0, EXIT_CODE):
                return code
        except AgvbenchError as error:
            if not interrupts.pressed:
                print(f"{program}: {error}", file=sys.stderr)
                return error.exit_code
        except KeyboardInterrupt as interrupt:
            why = f": {interrupt}" if str(interrupt) else ""
            print(f"{program}: interrupted{why}", file=sys.stderr)
            return int(getattr(interrupt, "exit_code", EXIT_CODE))  # another signal than Ctrl-C brings its own
        except (BrokenPipeError, SystemExit) as error:
            # rich ends the program where it finds that the reader (head, less) has gone.
            if isinstance(error, SystemExit) and not isinstance(error.__context__, BrokenPipeError):
                raise
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return _PIPE_CLOSED
        except Exception as error:  # noqa: BLE001 - whatever it is, users should not have to read a traceback
            if not interrupts.pressed:
                from agvbench.cli._failures import report_internal_error

                return report_internal_error(given[0], error)
        print(f"{program}: interrupted", file=sys.stderr)
        return EXIT_CODE


def _run(given: Sequence[str]) -> int:
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete

        argcomplete.autocomplete(build_parser())
    if not given or given[0] in {"-h", "--help"}:
        _print_help()
        return 0
    _check_words(given)
    parser = build_parser(None if given[0].startswith("-") else given[0])
    arguments, unknown = parser.parse_known_args(given)
    _require_utf_8(given)
    if unknown:
        raise _unknown_option(parser, arguments.command, unknown[0])
    _require_packages(arguments.command)
    return int(arguments.run(arguments))


def _print_help() -> None:
    """Print the help of ``agvbench`` without declaring the arguments of its commands, which takes longer."""
    parser = _program(_listed())
    _subparsers(parser)
    parser.print_help()


def _check_words(given: Sequence[str]) -> None:
    """Raise `FlagError` for a command that is none, and for a value that argparse takes for its own ``--``."""
    if not given[0].startswith("-") and given[0] not in (known := _command_names()):
        raise FlagError("no such command", value=given[0], remedy=f"{_meant(given[0], known)}agvbench --help lists all")
    for word in given:
        flag, _, value = word.partition("=")
        if flag.startswith("--") and value == "--":
            raise FlagError("value cannot be used", where=flag, value=value, remedy="give another")
