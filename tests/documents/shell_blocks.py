"""Read the blocks of a Markdown page, and execute its shell blocks as a reader would, in the order of the page."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^(?P<indent> *)```(?P<language>\w*)\n(?P<text>.*?)^(?P=indent)```$", re.DOTALL | re.MULTILINE)
FILE_NAME = re.compile(r"`([\w./-]+\.(?:py|toml))`")
OWN_NAME = re.compile(r'\A(?:"""|# )([\w./-]+\.py)\b')

# The command `agvbench` of a page: hardware becomes its simulation, whose batteries have no sessions of their own, and
# calls are logged with their exit codes.
COMMAND = """\
#!{python}
import json, os, re, subprocess, sys

called = sys.argv[1:]
hardware = r"serial:[^\\0]+|natnet:[\\d.]+"
given = re.sub(r"\\0--session\\0[^\\0]+", "", re.sub(hardware, "sim", "\\0".join(called))).split("\\0")
drives = given[:1] in (["bench"], ["loop"]) and not {{"--resume", "--dry-run"}} & set(given)
for option, value in json.loads(os.environ["PAGE_OPTIONS"]).items() if drives else ():
    given += [] if option in given else [option, value]
program = "import sys; from agvbench.cli import main; sys.exit(main())"
code = subprocess.run([sys.executable, "-c", program, *given]).returncode
with open(os.environ["PAGE_LOG"], "a") as log:
    log.write(json.dumps([called, code]) + "\\n")
# A comparison of two evenings may find that one is worse.
sys.exit(0 if called[:1] == ["compare"] and code == 1 else code)
"""


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and the file that the page says it is, if any."""

    language: str
    text: str
    file: str


def blocks(page: Path) -> list[Block]:
    """Return the blocks of `page`; a file's name stands in the paragraph before its block, or on its first line."""
    text, found = page.read_text(encoding="utf-8"), []
    for match in FENCE.finditer(text):
        content = textwrap.dedent(match["text"])
        before = FILE_NAME.findall(text[: match.start()].rstrip().rpartition("\n\n")[2])
        own = OWN_NAME.match(content)
        name = own[1] if own else before[-1] if before else ""
        found.append(Block(match["language"], content, name if match["language"] in ("python", "toml") else ""))
    return found


def shell(page: Path, *, without: tuple[str, ...] = ()) -> list[Block]:
    """Return the shell blocks of `page` but for those that run a command of agvbench named in `without`."""
    return [b for b in blocks(page) if b.language == "sh" and not any(f"agvbench {name}" in b.text for name in without)]


def write_files(page: Path, folder: Path) -> None:
    """Write the files of `page` into `folder`."""
    for block in blocks(page):
        if block.file:
            _write(block, folder)


def _write(block: Block, folder: Path) -> None:
    path = folder / block.file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(block.text)


def execute(
    page: Path, folder: Path, *, options: dict[str, str], without: tuple[str, ...] = ()
) -> list[tuple[list[str], int]]:
    """Write the page's files and run its shell blocks in `folder`; return the calls of agvbench with exit codes.

    `options` are given to benches that do not say otherwise; `without` as in `shell`. A block that changes the
    directory does so for those after it.

    Raises
    ------
    AssertionError
        If a block ends with an exit code other than 0.
    """
    here, log, programs = folder, folder / "calls.jsonl", folder / "programs"
    programs.mkdir()
    (programs / "agvbench").write_text(COMMAND.format(python=sys.executable))
    (programs / "agvbench").chmod(0o755)
    environment = os.environ | {"PAGE_OPTIONS": json.dumps(options), "PAGE_LOG": str(log)}
    environment["PATH"] = f"{programs}:{Path(sys.executable).parent}:{environment['PATH']}"
    chosen = shell(page, without=without)
    for block in blocks(page):
        if block.file:
            _write(block, here)
        elif block in chosen:
            program = f"set -euo pipefail\npip() {{ :; }}\n{block.text}\npwd > {folder / 'here'}"
            done = subprocess.run(
                ["bash", "-c", program], cwd=here, env=environment, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, f"{page.name}: exit code {done.returncode} of\n{block.text}{done.stderr}"
            here = Path((folder / "here").read_text().strip())
    return [tuple(json.loads(line)) for line in log.read_text().splitlines()]
