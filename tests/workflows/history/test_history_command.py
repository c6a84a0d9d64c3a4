"""``agvbench history`` as it is called, on simulated benches."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from datetime import timedelta

import numpy as np
import pandas as pd
import pytest
from history_samples import BEGAN, write_night, write_nights

from agvbench.cli import main
from agvbench.metrics.table import read_metrics


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Return three nights of a simulated bench, with another seed each; the last has no table of metrics any more."""
    lab = tmp_path_factory.mktemp("lab")
    for seed in (1, 2, 3):
        only = [
            "-k",
            "trajectory and (1-un or 5-un)",
            "--repeats",
            "1",
            "--seed",
            str(seed),
            "--out",
            f"nightly/{seed}",
        ]
        command = [sys.executable, "-m", "agvbench", "bench", *only]
        done = subprocess.run(command, cwd=lab, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    (lab / "nightly" / "3" / "errors.parquet").unlink()
    return lab / "nightly"


@pytest.mark.slow
def test_three_nights_of_a_bench(nights, tmp_path, capsys):
    (nights / "3" / "SHA256SUMS").write_text(
        "".join(
            line
            for line in (nights / "3" / "SHA256SUMS").read_text().splitlines(keepends=True)
            if not line.endswith("  errors.parquet\n")
        )
    )
    assert main(["history", str(nights), "--json", str(tmp_path / "h.json")]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "No series has enough nights to find a step: at most 3 nights, at least 10 are needed." in out
    made = json.loads((tmp_path / "h.json").read_text(encoding="utf-8"))
    assert [campaign["campaign"] for campaign in made["campaigns"]] == ["1", "2", "3"]
    assert {campaign["dated_by"] for campaign in made["campaigns"]} == {"provenance"}
    assert made["unread"] == []
    errors = [read_metrics(nights / name) for name in "123"]  # the third was evaluated again, and kept
    table = pd.read_parquet(nights / "history" / "nights.parquet")
    own = table[(table["metric"] == "position_error") & (table["trajectory"] == "")].sort_values("night")
    expected = [frame[frame["metric"] == "position_error"]["value"].mean() for frame in errors]
    np.testing.assert_allclose(own["value"], expected)


def test_the_page_shows_steps_charts_and_what_was_not_read(tmp_path, capsys):
    lab = write_nights(tmp_path / "lab", 30, step_mm=8.0, at=18)
    (lab / "night-03" / "campaign.toml").write_text("\x1b[31m")
    assert main(["history", str(lab), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "\x1b" not in said.out
    assert "not read: " in said.out
    page = (tmp_path / "out" / "history.html").read_text(encoding="utf-8")
    assert "firmware 2.0 → 2.1" in page
    assert page.count("<svg ") == 3
    assert "night-03/campaign.toml" in page
    assert not re.search(r"https?://(?!www\.w3\.org)", page)
    assert not (lab / "history").exists()


def test_equal_nights_show_that_the_program_changed(tmp_path, capsys):
    for night in range(20):
        error, version = (19.9, "0.3.0") if night >= 14 else (20.0, "0.2.0")
        values = {("position_error", "1"): [error] * 3}
        began = BEGAN + timedelta(days=night)
        write_night(tmp_path / "lab" / f"{night:02d}", values, began=began, agvbench=version)
    assert main(["history", str(tmp_path / "lab"), "--json", str(tmp_path / "h.json")]) == 0
    (step,) = json.loads((tmp_path / "h.json").read_text(encoding="utf-8"))["changes"]
    assert (step["campaign"], step["earliest"], step["latest"], step["sd"]) == ("14", "14", "14", 0.0)
    assert step["facts"] == [{"campaign": "14", "changed": "agvbench 0.2.0 → 0.3.0"}]
    assert "−∞" in capsys.readouterr().out


def test_the_same_campaigns_give_the_same_page(tmp_path, capsys):
    lab = write_nights(tmp_path / "lab", 12)
    for out in ("one", "two"):
        assert main(["history", str(lab), "--out", str(tmp_path / out)]) == 0
    assert (tmp_path / "one" / "history.html").read_bytes() == (tmp_path / "two" / "history.html").read_bytes()


@pytest.mark.skipif(os.geteuid() == 0, reason="an administrator may write everywhere")
@pytest.mark.slow
def test_campaigns_that_cannot_be_written_are_read_all_the_same(nights, tmp_path, capsys):
    (nights / "3" / "errors.parquet").unlink(missing_ok=True)
    (nights / "3").chmod(0o500)
    try:
        assert main(["history", str(nights), "--out", str(tmp_path)]) == 0
    finally:
        (nights / "3").chmod(0o700)
