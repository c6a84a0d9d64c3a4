"""The how-tos' examples, executed block by block."""

from __future__ import annotations

import contextlib
import io
import math
import re
import runpy
import shlex
from pathlib import Path

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.cli import main

HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how-to"
PAGE, ROS_PAGE = HOW_TO / "import-your-csv.md", HOW_TO / "exchange-with-ros.md"


def _execute(code: str) -> str:
    Path("block.py").write_text(code)
    with contextlib.redirect_stdout(io.StringIO()) as out:
        runpy.run_path("block.py")
    return out.getvalue()


def _lines(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip()]


def test_the_example_does_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert [language for language, _ in blocks] == ["python", "toml", "sh", "text", "python", "text"]
    make, mapping, command, account, look, listing = (text for _, text in blocks)
    _execute(make)
    Path("mapping.toml").write_text(mapping, encoding="utf-8")
    program, *arguments = shlex.split(command)
    assert program == "agvbench"
    assert main(arguments) == 0
    assert _lines(capsys.readouterr().out) == _lines(account)
    assert _lines(_execute(look)) == _lines(listing)

    for run in Campaign.open("campaigns/monday"):  # and the poses are on the circle that the program drew
        turn = run.frames.heading_rad
        np.testing.assert_allclose(run.frames.x_m, np.sin(turn), atol=1e-9)
        np.testing.assert_allclose(run.frames.y_m, 1.0 - np.cos(turn), atol=1e-9)
        np.testing.assert_allclose(np.unwrap(turn)[-1] - turn[0], 0.5 * run.frames.t_s[-1], atol=1e-9)
        assert math.isclose(run.commands.front[0], 1430.0)


def test_the_example_of_a_bag_prints_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```(\w+)\n(.*?)```", ROS_PAGE.read_text(encoding="utf-8"), re.DOTALL)
    _execute(next(text for language, text in blocks if language == "python"))
    commands = [text.splitlines()[-1] for language, text in blocks if language == "sh"]
    guess, account = [text for language, text in blocks if language == "text"][:2]
    mapping = next(text for language, text in blocks if language == "toml")
    for command, printed in ((commands[1], guess), (commands[2], account)):
        program, *arguments = shlex.split(command)
        assert program == "agvbench"
        assert main(arguments) == 0
        assert _lines(capsys.readouterr().out) == _lines(printed)
    assert set(_lines(mapping)[1:]) <= set(_lines(Path("bag.toml").read_text(encoding="utf-8")))
