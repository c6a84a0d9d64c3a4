"""Ctrl-C, whenever it comes: exit code 130 and one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial

import pytest

from agvbench.cli import main
from agvbench.cli.analysis import effects
from agvbench.errors import FitError

PROGRAM = """
import os, signal, sys

moment = sys.argv.pop(1)

class AtImport:
    def find_spec(self, name, path=None, target=None):
        if name == moment:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, AtImport())
from agvbench.__main__ import entry
entry()
"""
BENCH = ["bench", "trajectories", "-k", "1-uncalibrated", "--repeats=1", "--out=c"]


@pytest.mark.parametrize(
    ("moment", "command", "line"),
    [
        ("argparse", ["--help"], "agvbench: interrupted"),
        ("numpy", ["plan"], "agvbench plan: interrupted"),
        ("agvbench.pytest_plugin.collection", BENCH, "agvbench bench: interrupted"),
        ("zenoh.zenoh", BENCH, "ended by Ctrl-C, nothing was driven"),
        ("agvbench.reporting.write", BENCH, "agvbench bench: interrupted: no report; agvbench report c writes it"),
    ],
)
def test_whenever_it_comes_one_line_and_130(moment, command, line, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, moment, *command], cwd=tmp_path, capture_output=True, text=True, check=False,
        # Tests that a shell runs in the background have SIGINT ignored, and so would have what they start.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    # Progress, and whether machine code is kept already, is another matter.
    other = ("█", "·", "compiling the simulation")
    said = [text for text in (done.stdout + done.stderr).splitlines() if text and not text.startswith(other)]
    assert (done.returncode, said) == (130, [line])


@pytest.mark.parametrize("becomes", [FitError("not an arc"), RuntimeError("LLVM ERROR"), 2])
def test_what_an_extension_makes_of_it_is_still_ctrl_c(becomes, monkeypatch, capsys):
    def run(_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            if isinstance(becomes, int):
                return becomes
            raise becomes from None

    monkeypatch.setattr(effects, "run", run)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert main(["effects"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "agvbench effects: interrupted\n"
