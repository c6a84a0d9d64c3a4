"""The command line as people meet it: help that teaches, one line for a mistake, completion."""

from __future__ import annotations

import ast
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import agvbench.cli
from agvbench.cli import main

FILES = {
    Path(group.module_finder.path, group.name, f"{module.name}.py")
    for group in pkgutil.iter_modules(agvbench.cli.__path__)
    if group.ispkg
    for module in pkgutil.iter_modules([str(Path(group.module_finder.path, group.name))])
}
COMMANDS = {file.stem.removesuffix("_"): file for file in sorted(FILES)}
HEAVY = {
    "numpy",
    "pandas",
    "scipy",
    "numba",
    "matplotlib",
    "pyarrow",
    "zenoh",
    "rerun",
    "rich",
    "msgspec",
    "jinja2",
} | {"distributed", "dask"}
LONG = "x" * 300


def test_help_lists_every_command(capsys):
    assert main(["--help"]) == 0
    listed = capsys.readouterr().out
    for name in COMMANDS:
        assert f"\n  {name} " in listed


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_teaches_with_examples(name, capsys):
    with pytest.raises(SystemExit) as left:
        main([name, "--help"])
    assert left.value.code == 0
    assert f"agvbench {name}" in capsys.readouterr().out.partition("examples:")[2]


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_import_nothing_heavy(name):
    source = COMMANDS[name].read_text(encoding="utf-8")
    imported = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add((node.module or "").split(".")[0])
    assert not imported & HEAVY


def test_help_loads_nothing_heavy():
    program = "import sys; from agvbench.cli import build_parser; build_parser(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(done.stdout.split()) & HEAVY


def test_completion_offers_the_commands(tmp_path):
    answer = tmp_path / "answer"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": "agvbench ben",
        "COMP_POINT": "12",
    }
    program = "from agvbench.cli import main; main()"
    subprocess.run([sys.executable, "-c", program], env=environment, check=False, cwd=tmp_path, capture_output=True)
    assert answer.read_text(encoding="utf-8").split() == ["bench"]


def test_a_reader_that_left_is_no_error():
    program = "import sys; from agvbench.cli import main; sys.exit(main(['bench', '--help']))"
    command = f"'{sys.executable}' -c \"{program}\" | head -1"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert "Traceback" not in done.stderr


def test_a_reader_that_left_is_neither_success_nor_the_answer_no():
    program = (
        "import sys, rich, agvbench.cli as c;"
        " c._run = lambda given: [rich.print('x' * 99) for _ in range(2000)];"
        " sys.exit(c.main(['effects']))"
    )
    command = ["bash", "-c", f"'{sys.executable}' -c \"{program}\" | head -c 10; exit ${{PIPESTATUS[0]}}"]
    assert subprocess.run(command, capture_output=True, text=True, check=False).returncode == 141


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["bench", "--repeat=3"],
            "no such option: --repeat=3; did you mean --repeats? agvbench bench --help lists all",
        ),
        (["report", "somewhere", "--zzz"], "no such option: --zzz; agvbench report --help lists all"),
        (["bench", "--vehicle=v\x1b[2J"], "v\\x1b[2J: cannot read the vehicle file: No such file or directory"),
        (["init", "here", "there"], "one argument too many: there; see agvbench init --help"),
        (["plan", "--start=--"], "--start: value cannot be used: --; give another"),
        (["compare", "a", "b", "--fail-on=--"], "--fail-on: value cannot be used: --; give another"),
        (["report"], "the following arguments are required: DIR; see agvbench report --help"),
        (
            ["challenge", "--seeds", "1_000"],
            "argument --seeds: not a whole number: '1_000'; see agvbench challenge --help",
        ),
        (["bench", "--seed", "１０"], "argument --seed: not a whole number: '１０'; see agvbench bench --help"),
        (
            ["report", "c", "--margin-mm=1_0"],
            "argument --margin-mm: not a number: '1_0'; see agvbench report --help",
        ),
        (
            ["challenge", "--seeds", "18446744073709551616"],
            "--seeds: is too large: 18446744073709551616 (limit: at most 100000)",
        ),
    ],
)
def test_a_command_line_that_cannot_be_used_is_one_line(arguments, told, capsys):
    assert main(arguments) == 2
    assert capsys.readouterr().err == f"agvbench {arguments[0]}: {told}\n"


def test_one_thread_for_small_matrices_unless_told_otherwise(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    assert main(["effects"]) == 0
    assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["MKL_NUM_THREADS"]) == ("3", "1")


def test_a_choice_of_no_run_is_said_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "-k", "nosuchrun"]) == 2
    assert "agvbench bench: -k: no run to drive: nosuchrun; see what there is with --dry-run" in capsys.readouterr().err


def test_an_argument_that_is_not_utf_8_is_one_line(capsys):
    assert main(["report", "campaigns/r\udcff"]) == 2
    line = "agvbench report: argument is not UTF-8: 'campaigns/r\\udcff'; rename the file or directory\n"
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(
    "arguments",
    [
        ["compare", LONG, "b"],
        ["report", LONG],
        ["diagnose", LONG],
        ["calibrate", LONG],
        ["init", LONG],
        ["bench", LONG],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_path_that_no_file_can_have_is_one_line(arguments, capsys):
    assert main(arguments) == 2
    errors = capsys.readouterr().err
    assert errors == f"agvbench {arguments[0]}: {LONG}: File name too long; give a shorter path\n"


def test_alone_it_prints_help(capsys):
    assert main([]) == 0
    assert "\n  bench " in capsys.readouterr().out


def test_an_unknown_command_suggests_the_nearest(capsys):
    assert main(["bnech"]) == 2
    said = "agvbench: no such command: bnech; did you mean bench? agvbench --help lists all\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["bench", "--repeats=0"], "--repeats: value cannot be used: 0"),
        (["bench", "--workspace=hall"], "workspace cannot be read: 'hall'"),
        (["loop", "--vehicle=none.toml"], "none.toml: cannot read the vehicle file"),
        (["bench", "--agv=serail:/dev/ttyACM0"], "no such agv adapter: 'serail'"),
        (["bench", "--mocap=natnte:lab"], "no such mocap adapter: 'natnte'"),
        (["bench", "--camera=lost"], "--camera: not a parameter and its value: 'lost'"),
        (["bench", "--camera=lots=0.1"], "camera: unknown option: 'lots'"),
        (["bench", "--mocap=natnet:lab", "--camera=up=x"], "--camera up: unknown vertical axis: x"),
        (["bench", "--mocap=natnet:emulated", "--camera=packet_lots=1"], "no such fault of packets: packet_lots"),
        (["bench", "--mocap=impaired:lost:natnet:lab:http"], "port is out of range: http"),
        (["loop", "--agv=smi"], "no such agv adapter: 'smi'"),
    ],
)
def test_a_wrong_value_is_refused_before_what_takes_long_to_import(arguments, told, tmp_path):
    program = (
        "import sys; from agvbench.cli import main; code = main(sys.argv[1:])\n"
        "print(*{'pandas', 'numba', 'zenoh', 'scipy', 'pytest'} & set(sys.modules)); sys.exit(code)"
    )
    command = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout.strip()) == (2, "")
    assert told in done.stderr
