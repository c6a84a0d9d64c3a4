"""Every line of docs/reference/errors-diagnose.md, word for word, on campaigns that cannot be diagnosed.

``python tests/diagnosis/test_foreign_errors.py`` writes the page again from the cases.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tiny_vehicle import InMemory, Tiny, campaign_runs

from agvbench.cli import main
from agvbench.diagnosis import Verdict, diagnose
from agvbench.errors import AgvbenchError
from agvbench.types import Frames, Run

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "errors-diagnose.md"
_INTRODUCTION = """\
# Bad input: campaigns that cannot be diagnosed

The tables of these campaigns are complete and have the right schema ([other tables](errors-campaign.md) are rejected
when they are opened), but no vehicle can produce their contents. `agvbench diagnose` prints an error of one line and
exits with code 2. Every case is a test.

| case | input | message |
|---|---|---|
"""


def _frames(change: Callable[[Frames], dict[str, np.ndarray]], every: int = 1) -> Callable[[list[Run]], list[Run]]:
    """Return runs of which every so many-th has its frames changed."""

    def changed(run: Run) -> Run:
        return dataclasses.replace(run, frames=dataclasses.replace(run.frames, **change(run.frames)))

    return lambda runs: [changed(run) if k % every == 0 else run for k, run in enumerate(runs)]


def _clock_set_back(f: Frames) -> dict[str, np.ndarray]:
    return {"t_s": np.where(np.arange(len(f)) > len(f) // 2, f.t_s - 2.0, f.t_s)}


def _longer(f: Frames) -> dict[str, np.ndarray]:
    return {"x_m": f.x_m[0] + 1.1 * (f.x_m - f.x_m[0]), "y_m": f.y_m[0] + 1.1 * (f.y_m - f.y_m[0])}


def _mixed(runs: list[Run]) -> list[Run]:
    order = np.random.default_rng(0).permutation(len(runs))
    return [dataclasses.replace(run, frames=runs[k].frames) for run, k in zip(runs, order, strict=True)]


CASES: dict[str, tuple[str, Callable[[list[Run]], list[Run]]]] = {
    "few-runs": ("five runs", lambda runs: runs[:5]),
    "no-run": (
        "no run whose status is ok",
        lambda runs: [dataclasses.replace(run, status="rejected: bumped") for run in runs],
    ),
    "never-seen": ("poses that are all untracked", _frames(lambda f: {"tracked": np.zeros(len(f), dtype=bool)})),
    "clock-set-back": ("a clock that is set back in the middle of runs", _frames(_clock_set_back)),
    "milliseconds": ("times in ms", _frames(lambda f: {"t_s": 1e3 * f.t_s})),
    "mirrored": ("headings counted clockwise", _frames(lambda f: {"heading_rad": -f.heading_rad})),
    "axes-swapped": ("x and y swapped", _frames(lambda f: {"x_m": f.y_m, "y_m": f.x_m})),
    "no-heading": ("a heading that stays zero", _frames(lambda f: {"heading_rad": np.zeros(len(f))})),
    "frames-of-others": ("frames that belong to other runs", _mixed),
    "two-vehicles": ("half of the runs of a vehicle that is 10 % faster", _frames(_longer, every=2)),
    "split-all-fit": (
        "a column split without held-out runs",
        lambda runs: [dataclasses.replace(run, split="fit") for run in runs],
    ),
}


def _message(case: str, runs: list[Run]) -> str:
    with pytest.raises(AgvbenchError) as caught:
        diagnose(InMemory(CASES[case][1](runs)))
    assert caught.value.exit_code == 2
    return str(caught.value)


def _documented() -> dict[str, str]:
    rows = [line.strip("|\n ").split(" | ", 2) for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return {row[0].strip("`"): row[2].strip("`") for row in rows if row[0].startswith("`")}


@pytest.mark.parametrize("case", CASES)
def test_message(case, tiny_campaign):
    message = _message(case, tiny_campaign(Tiny()).runs)
    assert message == _documented()[case]
    assert "\n" not in message


def test_the_page_lists_each_case_and_nothing_else():
    assert list(_documented()) == list(CASES)


def test_the_command_prints_one_line(tmp_path, tiny_campaign, write_campaign, capsys):
    path = write_campaign(tmp_path / "c", CASES["mirrored"][1](tiny_campaign(Tiny()).runs[:40]))
    assert main(["diagnose", str(path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == f"agvbench diagnose: {_documented()['mirrored']}\n"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"drive": 1500.0}, "the drive was never commanded anything but neutral"),
        ({"front": 1500.0, "rear": 1500.0}, "steering was never excited"),
    ],
)
def test_what_was_never_commanded_is_not_identifiable(tiny_campaign, change, why):
    runs = []
    for run in tiny_campaign(Tiny()).runs[:30]:
        told = {name: np.full(len(run.commands), value) for name, value in change.items()}
        runs.append(dataclasses.replace(run, commands=dataclasses.replace(run.commands, **told)))
    found = diagnose(InMemory(runs))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert why in found.why


def test_a_table_in_any_order_is_read_alike(tiny_campaign):
    from agvbench.diagnosis.data.readings import read_runs

    runs = tiny_campaign(Tiny()).runs[:4]
    rng = np.random.default_rng(0)
    shuffled = [dataclasses.replace(run, frames=run.frames.select(rng.permutation(len(run.frames)))) for run in runs]
    assert np.array_equal(read_runs(shuffled).poses, read_runs(runs).poses)


if __name__ == "__main__":
    driven = campaign_runs(Tiny())
    lines = [f"| `{name}` | {given} | `{_message(name, driven)}` |\n" for name, (given, _) in CASES.items()]
    PAGE.write_text(_INTRODUCTION + "".join(lines), encoding="utf-8")
