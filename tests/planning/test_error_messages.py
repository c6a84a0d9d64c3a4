"""Every mistake in docs/reference/errors-trajectories.md ends in exactly the line that stands there."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from agvbench.cli import main
from agvbench.model import example_path

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "errors-trajectories.md"
CASE = re.compile(
    r"^## (?P<title>.+?)\n+(?:```toml\n(?P<toml>.*?)```\n+)?```console\n\$ (?P<command>.+?)\n(?P<message>.*?)```",
    re.DOTALL | re.MULTILINE,
)
CASES = [match.groupdict() for match in CASE.finditer(PAGE.read_text(encoding="utf-8"))]


def test_the_page_has_cases_and_each_is_read():
    assert len(CASES) >= 30
    assert len(CASES) == PAGE.read_text(encoding="utf-8").count("\n## ")


@pytest.mark.parametrize("case", CASES, ids=[case["title"] for case in CASES])
def test_message(case, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copy(example_path("front_steered"), tmp_path / "front_steered.toml")
    if case["toml"]:
        (tmp_path / "bad.toml").write_text(case["toml"], encoding="utf-8")
    program, *arguments = shlex.split(case["command"])
    assert program == "agvbench"
    assert main(arguments) == 2
    assert capsys.readouterr().err == case["message"]
    assert case["message"].count("\n") == 1
