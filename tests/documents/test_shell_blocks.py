"""Every shell block of README, tutorial and how-tos runs as it stands.

Here benches drive two repeats, and diagnoses and pages that take minutes are left out. With
``AGVBENCH_DOCUMENTS=blocks`` every block runs, still with two repeats. With ``AGVBENCH_DOCUMENTS=full``, which
``nox -s documents`` sets, every page runs with every repeat, and README's first command in a clone of its own.
``AGVBENCH_SEED`` is the seed of benches that name none.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest
from shell_blocks import execute, shell, write_files

ROOT = Path(__file__).parents[2]
QUICK = (
    "docs/how-to/exchange-with-ros.md",
    "docs/how-to/nightly.md",
    "docs/how-to/use-recordings.md",
    "docs/how-to/watch-a-bench.md",
    "docs/how-to/write-a-trajectory.md",
    "docs/tutorial.md",
)
SLOW = (
    "docs/how-to/add-a-metric.md",
    "docs/how-to/add-a-report-section.md",
    "docs/how-to/bring-your-own-plant.md",
    "docs/how-to/close-the-loop.md",
    "docs/how-to/control-in-closed-loop.md",
    "docs/how-to/drive-a-differential-vehicle.md",
    "docs/how-to/set-up-a-lab.md",
    "docs/how-to/sweep-on-many-machines.md",
    "docs/how-to/write-an-effect.md",
)
FILES_OF = {"docs/how-to/write-an-effect.md": "docs/how-to/bring-your-own-plant.md"}
"""The page whose files the reader of a page has already."""
ELSEWHERE = {
    "docs/how-to/import-your-csv.md": "tests/campaign/test_campaign_how_to.py",
    "docs/how-to/install.md": "tests/packaging/test_install.py",
}
QUICK_WITHOUT = ("diagnose",)
FULL = os.environ.get("AGVBENCH_DOCUMENTS") == "full"
EVERY_BLOCK = os.environ.get("AGVBENCH_DOCUMENTS") in ("full", "blocks")
pytestmark = pytest.mark.timeout(7200 if EVERY_BLOCK else 600)
LONG = {
    "docs/tutorial.md",
    "docs/how-to/nightly.md",
    "docs/how-to/watch-a-bench.md",
    "docs/how-to/exchange-with-ros.md",
}
"""Those of the quick pages that take more than ten seconds."""
takes_minutes = pytest.mark.skipif(not FULL, reason="takes minutes: nox -s documents")


def _options() -> dict[str, str]:
    options = {} if FULL else {"--repeats": "2", "--exchange": "2"}
    return options | ({"--seed": os.environ["AGVBENCH_SEED"]} if "AGVBENCH_SEED" in os.environ else {})


PAGES = [
    *(pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in QUICK),
    *(pytest.param(name, marks=takes_minutes) for name in SLOW),
]


@pytest.mark.parametrize("name", PAGES)
def test_every_shell_block_of_a_page_runs(name, tmp_path):
    page, without = ROOT / name, () if EVERY_BLOCK else QUICK_WITHOUT
    if name in FILES_OF:
        write_files(ROOT / FILES_OF[name], tmp_path)
    called = execute(page, tmp_path, options=_options(), without=without)
    stated = [line for block in shell(page, without=without) for line in block.text.splitlines()]
    assert len(called) == sum(len(re.findall(r"\bagvbench \w", line.partition("#")[0])) for line in stated) > 0


@takes_minutes
def test_the_first_command_of_the_readme_runs_in_a_clone(tmp_path):
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(tmp_path / "clone")], check=True)
    bench, tests = (block.text for block in shell(ROOT / "README.md"))
    assert tests.splitlines()[-1] == bench.splitlines()[-1].replace("nox -s bench", "nox -s tests")
    done = subprocess.run(["bash", "-euc", bench], cwd=tmp_path / "clone", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "report.html" in done.stdout


def test_no_page_with_shell_blocks_is_forgotten():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "how-to").glob("*.md")]
    named = {str(page.relative_to(ROOT)) for page in pages if shell(page)}
    assert named == {"README.md", *QUICK, *SLOW, *ELSEWHERE}
