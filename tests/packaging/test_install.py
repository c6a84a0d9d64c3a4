"""The commands of the page on installing work as stated, with this checkout in place of the URL."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
URL = "git+https://github.com/agvbench/agvbench"
BLOCKS = re.findall(r"```sh\n(.*?)```", (ROOT / "docs/how-to/install.md").read_text(encoding="utf-8"), re.DOTALL)
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]


def _program(name):
    return shutil.which(name, path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")


@pytest.mark.parametrize("block", BLOCKS, ids=[block.split()[0] + str(n) for n, block in enumerate(BLOCKS)])
def test_a_command_of_the_page_installs_and_runs(block, tmp_path):
    [line] = block.splitlines()
    program = line.split()[0]
    found = _program("uv" if program == "uvx" else program)
    if found is None:
        pytest.skip(f"{program} is not installed")
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    own = {"PIPX_HOME": str(tmp_path / "pipx"), "PIPX_BIN_DIR": str(tmp_path / "bin")}
    command = line.replace(URL, f"git+file://{clone}").replace(
        program, f"{found} tool run" if program == "uvx" else found, 1
    )
    done = subprocess.run(
        ["bash", "-euc", command], cwd=tmp_path, env=os.environ | own, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    if program == "pipx":
        version = subprocess.run(
            [tmp_path / "bin" / "agvbench", "--version"], capture_output=True, text=True, check=True
        )
        assert version.stdout.startswith("agvbench ")
    else:
        assert " runs, " in done.stdout
