from __future__ import annotations

import dataclasses
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from campaign_samples import HEADER, assert_same_run, make_run
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.campaign.manifest import MANIFEST_FILE
from agvbench.campaign.tables.parts import part_name, run_id_of
from agvbench.errors import CampaignError
from agvbench.types import NO_TARGET, Commands, Frames


def _bytes(directory: Path) -> dict[str, bytes]:
    """Return every file's content by path, of the list of hashes without comments."""
    files = {str(file.relative_to(directory)): file.read_bytes() for file in directory.rglob("*") if file.is_file()}
    return files | {MANIFEST_FILE: re.sub(rb"#.*\n", b"", files[MANIFEST_FILE])}


def test_what_is_appended_is_read_again_bit_by_bit(tmp_path: Path) -> None:
    runs = [
        make_run("a", seed=1),
        make_run("b/ü 1", seed=2, started_s=5.0, target=NO_TARGET, session="s", split="fit", extra={"battery_v": 7.2}),
        make_run("c", seed=3, started_s=9.0, status="rejected: lost", frames=0, extra={"note": "x", "tries": 2}),
    ]
    writer = CampaignWriter.create(tmp_path / "new", HEADER)
    for run in runs:
        writer.append(run)
    campaign = Campaign.open(tmp_path / "new")
    assert campaign.header == HEADER
    for expected, run in zip(runs, campaign, strict=True):
        assert_same_run(expected, run)


@settings(max_examples=40, deadline=None)
@given(data=st.data(), count=st.integers(1, 40))
def test_any_frames_survive(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, count: int) -> None:
    positions = arrays(np.float64, count, elements=st.floats(-400.0, 400.0))
    x_m, y_m, heading_rad = data.draw(positions), data.draw(positions), data.draw(positions) / 500.0
    t_s = data.draw(arrays(np.float64, count, elements=st.floats(-100.0, 100.0)))
    tracked = data.draw(arrays(np.bool_, count))
    x_m, y_m, heading_rad = (np.where(tracked, values, np.nan) for values in (x_m, y_m, heading_rad))
    frame = data.draw(arrays(np.int64, count))
    frames = Frames(t_s, x_m, y_m, heading_rad, tracked, frame, np.full(count, np.nan), t_s + 0.01)
    run = make_run("any", frames=0)
    run = dataclasses.replace(run, frames=frames)
    path = tmp_path_factory.mktemp("any")
    CampaignWriter.create(path, HEADER, durable=False).append(run)
    assert_same_run(run, Campaign.open(path).run("any"))


@given(st.text(min_size=1, max_size=20).filter(lambda text: text.isprintable()))
def test_a_part_is_named_after_its_run(run_id: str) -> None:
    name = part_name(run_id)
    assert "/" not in name
    assert not name.startswith(".")
    assert run_id_of(Path(name)) == run_id


def test_same_runs_give_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        writer = CampaignWriter.create(tmp_path / name, HEADER)
        for run_id in "ab":
            writer.append(make_run(run_id, seed=ord(run_id)))
        writer.write_table("events", pd.DataFrame({"t_s": [1.0], "what": ["stop"]}))
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")


def test_resume_removes_what_was_never_finished(tmp_path: Path) -> None:
    writer = CampaignWriter.create(tmp_path, HEADER)
    for run_id in "ab":
        writer.append(make_run(run_id))
    whole = _bytes(tmp_path)
    (tmp_path / "runs.parquet" / "b.parquet").unlink()  # killed between the poses and the runs part
    listed = tmp_path / MANIFEST_FILE
    listed.write_text(listed.read_text().rpartition("#")[0])
    (tmp_path / "poses.parquet" / ".tmp-c.parquet").write_bytes(b"PAR1 half")
    # What somebody else put there is nobody's unfinished run.
    (tmp_path / "poses.parquet" / "notes.txt").write_text("the floor was wet")
    (tmp_path / "poses.parquet" / ".ipynb_checkpoints").mkdir()
    assert Campaign.open(tmp_path).check().run_ids == ["a"]

    writer = CampaignWriter.resume(tmp_path, HEADER)
    assert writer.finished_ids == ["a"]
    assert sorted(writer.recovered) == [
        "commands.parquet/b.parquet",
        "poses.parquet/.tmp-c.parquet",
        "poses.parquet/b.parquet",
    ]
    writer.append(make_run("b"))
    (tmp_path / "poses.parquet" / "notes.txt").unlink()
    (tmp_path / "poses.parquet" / ".ipynb_checkpoints").rmdir()
    assert _bytes(tmp_path) == whole


_KILLED = """
import sys
sys.path.insert(0, {tests!r})
from campaign_samples import HEADER, make_run
from agvbench.campaign import CampaignWriter
writer = CampaignWriter.create({path!r}, HEADER, durable=False)
for number in range(100000):
    writer.append(make_run(f"r{{number:05d}}", frames=1200, seed=number, started_s=float(number)))
    print(number, flush=True)
"""


@pytest.mark.parametrize("finished", [1, 12])
def test_every_finished_run_survives_kill_9(tmp_path: Path, finished: int) -> None:
    code = _KILLED.format(tests=str(Path(__file__).parent), path=str(tmp_path / "c"))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        reported = [int(process.stdout.readline()) for _ in range(finished)]
        os.kill(process.pid, signal.SIGKILL)
        reported += [int(line) for line in process.stdout]
    writer = CampaignWriter.resume(tmp_path / "c", HEADER, durable=False)
    assert writer.finished_ids[: len(reported)] == [f"r{number:05d}" for number in reported]
    for number, run in enumerate(Campaign.open(tmp_path / "c")):
        assert_same_run(make_run(f"r{number:05d}", frames=1200, seed=number, started_s=float(number)), run)


def test_a_run_that_nobody_could_read_again_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    writer = CampaignWriter.create(tmp_path, HEADER)
    before = _bytes(tmp_path)
    run = make_run("a")
    backwards = Commands(run.commands.t_s[::-1], run.commands.drive, run.commands.front, run.commands.rear)
    with pytest.raises(CampaignError, match="t_s does not increase"):
        writer.append(dataclasses.replace(run, commands=backwards))
    with pytest.raises(CampaignError, match="status"):
        writer.append(dataclasses.replace(run, status="fine"))
    assert _bytes(tmp_path) == before
    assert writer.finished_ids == []


def test_a_further_table_is_replaced_and_read(tmp_path: Path) -> None:
    writer = CampaignWriter.create(tmp_path, HEADER)
    writer.append(make_run("a"))
    for count in (1, 2):
        writer.write_table("events", pd.DataFrame({"t_s": np.arange(count) * 1.0, "what": ["stop"] * count}))
    events = Campaign.open(tmp_path).table("events")
    assert events["what"].to_list() == ["stop", "stop"]


def test_nonsense_in_lost_frames_is_no_obstacle(tmp_path: Path) -> None:
    run = make_run("a", frames=4)
    wild = np.array([0.0, np.inf, -np.inf, np.nan])
    seen = np.array([True, False, False, True])
    frames = dataclasses.replace(run.frames, x_m=wild, y_m=wild, heading_rad=wild, tracked=seen)
    CampaignWriter.create(tmp_path, HEADER).append(dataclasses.replace(run, frames=frames))
    assert Campaign.open(tmp_path).run("a").frames.tracked.tolist() == [True, False, False, False]
