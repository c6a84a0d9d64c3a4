"""The how-to's examples of adapters pass the project's own style and type checks, and the clock's example runs."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from shell_blocks import blocks

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "write-an-adapter.md"
ROS_PAGE = ROOT / "docs" / "how-to" / "exchange-with-ros.md"


def run_tool(name: str, *arguments: str) -> None:
    """Run a tool of the session ``lint``; where only the tests' requirements are installed, nothing can be checked."""
    if importlib.util.find_spec(name) is None:
        pytest.skip(f"{name} is not installed: nox -s lint")
    command = [sys.executable, "-m", name, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("examples"), []
    for block in blocks(PAGE):
        if block.language == "python" and block.text.startswith('"""'):
            found.append(folder / block.file)
            found[-1].write_text(block.text, encoding="utf-8")
    for block in blocks(ROS_PAGE):
        if block.file == "ros2_lab.py":
            found.append(folder / block.file)
            found[-1].write_text(block.text, encoding="utf-8")
    assert [file.name for file in found] == ["my_lab.py", "stand_in.py", "ros2_lab.py"]
    return [str(file) for file in found]


def test_the_examples_pass_the_style_checks(examples):
    run_tool("ruff", "check", "--config=pyproject.toml", "--no-cache", *examples)
    run_tool("ruff", "format", "--check", "--config=pyproject.toml", "--no-cache", *examples)


@pytest.mark.slow
def test_the_examples_pass_the_type_checks(examples):
    run_tool("mypy", "--strict", "--config-file=pyproject.toml", *examples)


def test_the_one_way_clock_removes_all_but_the_least_delay():
    (block,) = (block for block in blocks(PAGE) if "class OneWayClock" in block.text)
    exec(block.text, {})  # noqa: S102  (the page's own assertions)
