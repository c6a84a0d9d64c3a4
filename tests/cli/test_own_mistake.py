"""A mistake of agvbench itself: one line, an exit code of its own, and the traceback kept for who mends it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agvbench.cli import main
from agvbench.cli.analysis import effects


@pytest.fixture
def broken(monkeypatch, tmp_path):
    """Break a command, and let temporary files lie in `tmp_path`."""

    def run(_):
        return [0][1:][0]

    monkeypatch.setattr(effects, "run", run)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_mistake_of_its_own_is_one_line_with_the_file_to_report(broken, monkeypatch, capsys):
    monkeypatch.delenv("AGVBENCH_DEBUG", raising=False)
    assert main(["effects"]) == 70
    told = capsys.readouterr()
    assert told.out == ""
    (line,) = told.err.splitlines()
    kept = re.fullmatch(
        r"agvbench effects: IndexError list index out of range at .*test_own_mistake\.py:\d+: "
        r"a mistake of agvbench itself; please report it with (.*)",
        line,
    )
    assert kept is not None
    text = Path(kept[1]).read_text(encoding="utf-8")
    assert Path(kept[1]).parent == broken
    assert "return [0][1:][0]" in text
    assert text.rstrip().endswith("IndexError: list index out of range")


def test_without_a_place_for_the_traceback_the_line_says_how_to_see_it(broken, monkeypatch, capsys):
    monkeypatch.delenv("AGVBENCH_DEBUG", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(broken / "no such directory"))
    assert main(["effects"]) == 70
    assert capsys.readouterr().err.endswith("with its traceback (AGVBENCH_DEBUG=1 shows it)\n")


def test_who_mends_it_sees_the_traceback(broken, monkeypatch):
    monkeypatch.setenv("AGVBENCH_DEBUG", "1")
    with pytest.raises(IndexError):
        main(["effects"])
