"""The tables of blind trials in the documents are what the files beside them score."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agvbench.challenge.campaigns import TrialKind
from agvbench.challenge.challenge import known_trials, write_trials
from agvbench.challenge.scores import score
from agvbench.reporting.console.challenge import scores_markdown

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
PAGE = (REFERENCE / "blind-trials.md").read_text(encoding="utf-8")
FILES = sorted((REFERENCE / "blind-trials").glob("*.json"))


def kind(file: Path) -> TrialKind:
    """Return what the trials of a published file share, as its name says."""
    return TrialKind(5, "differential" if file.stem.startswith("differential") else "two_axle")


def test_there_are_files():
    assert [file.name for file in FILES] == [
        "change-9841.json", "change-9881.json", "change-9931.json", "change-9941.json", "change-9951.json",
        "change-9961.json", "change-9971.json", "change-9981.json", "change-9991.json", "differential-8000.json",
        "differential-8001.json", "differential-8002.json", "hysteresis-9040.json", "nothing-20168.json",
        "nothing-31200.json", "nothing-31500.json", "nothing-31800.json", "nothing-32100.json", "nothing-32400.json",
        "nothing-32700.json", "nothing-32846.json", "nothing-32975.json", "vehicles-9030.json", "vehicles-9751.json",
    ]  # fmt: skip


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_page_says_what_the_file_scores(file):
    trials = known_trials(file, kind(file))
    assert f"blind-trials/{file.name}" in PAGE
    assert scores_markdown(score(list(trials.values()))) in PAGE


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_file_is_as_it_would_be_written_now(file, tmp_path):
    write_trials(tmp_path / "again.json", kind(file), list(known_trials(file, kind(file)).values()))
    (text, numbers), (published, before) = map(apart, (tmp_path / "again.json", file))
    assert text == published
    # SciPy's quantiles differ between versions in the last digits.
    assert numbers == pytest.approx(before, rel=1e-9, abs=0.0)


def apart(file: Path) -> tuple[str, list[float]]:
    """Return a file's text without its fractions, and the fractions."""
    fraction = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
    text = file.read_text(encoding="utf-8")
    return fraction.sub("…", text), [float(number) for number in fraction.findall(text)]
