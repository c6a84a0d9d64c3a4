"""Damage to a recorded campaign is found when it is read, and what an interruption leaves is no damage."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from campaign_samples import HEADER, make_run, write_campaign

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.campaign.manifest import MANIFEST_FILE
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.campaign.tables.schema import TABLES
from agvbench.errors import CampaignError

BESIDE = "vehicle.toml"
FILES = ("campaign.toml", BESIDE, "events.parquet", *(f"{t}.parquet/a.parquet" for t in ("poses", "commands", "runs")))


@pytest.fixture
def writer(tmp_path: Path) -> CampaignWriter:
    writer = CampaignWriter.create(tmp_path / "c", HEADER, durable=False)
    writer.append(make_run("a"))
    writer.write_table("events", pd.DataFrame({"t_s": [0.5], "what": ["stop"]}))
    writer.write_beside(BESIDE, lambda path: path.write_text("schema = 1\n"))
    return writer


def flip(file: Path, bit: int) -> None:
    data = bytearray(file.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    file.write_bytes(data)


@pytest.mark.parametrize("name", FILES)
def test_every_flipped_bit_is_found_on_reading_and_on_resuming(name: str, writer: CampaignWriter) -> None:
    file = writer.path / name
    bits = 8 * file.stat().st_size
    for bit in range(0, bits, max(1, bits // 20)):
        flip(file, bit)
        for use in (lambda: Campaign.open(writer.path).check(), lambda: CampaignWriter.resume(writer.path, HEADER)):
            with pytest.raises(CampaignError) as caught:
                use()
            assert "\n" not in str(caught.value)
            assert str(file) in str(caught.value)
        flip(file, bit)
    Campaign.open(writer.path).check()


def test_checksums_of_pages_find_damage_where_no_list_does(writer: CampaignWriter) -> None:
    writer.append(make_run("long", frames=1200))
    file = writer.path / "poses.parquet" / "long.parquet"
    read_parquet(file)
    bits = range(0, 8 * file.stat().st_size, 1501)
    missed = 0
    for bit in bits:
        flip(file, bit)
        try:
            read_parquet(file)
        except CampaignError:
            pass
        else:
            missed += 1
        flip(file, bit)
    assert missed <= 0.05 * len(bits)  # not in a page: names and sizes


def test_what_an_interruption_leaves_is_no_damage(writer: CampaignWriter) -> None:
    listed = writer.path / MANIFEST_FILE
    whole = listed.read_text()
    writer.write_beside(BESIDE, lambda path: path.write_text("schema = 1 # replaced\n"))
    listed.write_text(whole)  # the list was lost by a power cut, or the file is older than the list
    with pytest.raises(CampaignError, match="has changed since it was recorded"):
        Campaign.open(writer.path)
    writer.write_beside(BESIDE, lambda path: path.write_text("schema = 1\n"))
    left = f"{'0' * 64}  runs.parquet/b.parquet\n{'1' * 64}  {BESIDE}\n12ab"
    listed.write_text(listed.read_text() + left)
    Campaign.open(writer.path).check()  # listed and not there yet; listed anew and not replaced yet; a line cut off
    writer.append(make_run("b", started_s=1.0))
    assert len(Campaign.open(writer.path).check()) == 2
    CampaignWriter.resume(writer.path, HEADER)
    checked = subprocess.run(["sha256sum", "--check", "--strict", MANIFEST_FILE], cwd=writer.path, check=False)
    assert checked.returncode == 0


def test_a_changed_file_is_kept_by_deleting_its_line(writer: CampaignWriter) -> None:
    (writer.path / BESIDE).write_text("schema = 1 # mine\n")
    with pytest.raises(CampaignError, match=f"delete its line in {MANIFEST_FILE}"):
        Campaign.open(writer.path)
    listed = writer.path / MANIFEST_FILE
    listed.write_text("".join(line for line in listed.read_text().splitlines(True) if BESIDE not in line))
    Campaign.open(writer.path)
    CampaignWriter.resume(writer.path, HEADER)
    assert BESIDE in listed.read_text()


def test_campaigns_without_a_list_are_read_and_resumed(writer: CampaignWriter, tmp_path: Path) -> None:
    Campaign.open(write_campaign(tmp_path / "foreign")).check()
    (writer.path / MANIFEST_FILE).unlink()
    assert CampaignWriter.resume(writer.path, HEADER).finished_ids == ["a"]
    assert [name for name in FILES if name not in (writer.path / MANIFEST_FILE).read_text()] == []


RUN_A = [f"{table}.parquet/a.parquet" for table in ("poses", "commands", "runs")]


@pytest.mark.parametrize("names", [RUN_A, RUN_A[2:], RUN_A[:1], [BESIDE], ["events.parquet"]])
def test_a_recorded_file_that_is_missing_is_named_and_nothing_is_removed(
    names: list[str], writer: CampaignWriter, give_up: Callable[[Path, str], None]
) -> None:
    writer.append(make_run("b", started_s=1.0))
    listed = writer.path / MANIFEST_FILE
    for _ in range(2):
        for name in names:
            (writer.path / name).rename(writer.path.parent / name.replace("/", "-"))
        before = {file: file.read_bytes() for file in writer.path.rglob("*") if file.is_file()}
        for use in (lambda: Campaign.open(writer.path), lambda: CampaignWriter.resume(writer.path, HEADER)):
            with pytest.raises(CampaignError, match=f"lacks files that {MANIFEST_FILE} lists: {', '.join(names)};"):
                use()
        assert {file: file.read_bytes() for file in writer.path.rglob("*") if file.is_file()} == before
        for name in names:
            (writer.path.parent / name.replace("/", "-")).rename(writer.path / name)
        CampaignWriter.resume(writer.path, HEADER)  # lists them anew
    (writer.path / names[0]).unlink()
    if names[0] in RUN_A:  # as the message advises
        give_up(writer.path, "a")
        CampaignWriter.resume(writer.path, HEADER).append(make_run("a"))
    else:
        listed.write_text("".join(line for line in listed.read_text().splitlines(True) if names[0] not in line))
        CampaignWriter.resume(writer.path, HEADER)
    assert Campaign.open(writer.path).check().run_ids == ["a", "b"]


def test_a_table_that_is_missing_as_a_whole_is_refused_before_anything_is_removed(writer: CampaignWriter) -> None:
    (writer.path / "runs.parquet").rename(writer.path.parent / "runs.parquet")
    with pytest.raises(CampaignError, match="lacks files"):
        CampaignWriter.resume(writer.path, HEADER)
    (writer.path.parent / "runs.parquet").rename(writer.path / "runs.parquet")
    assert Campaign.open(writer.path).check().run_ids == ["a"]


def test_a_users_own_files_are_not_listed(writer: CampaignWriter) -> None:
    for name in ("next.toml", "mine.parquet"):
        (writer.path / name).write_text("1")
    CampaignWriter.resume(writer.path, HEADER)
    (writer.path / "next.toml").write_text("2")
    (writer.path / "mine.parquet").unlink()
    CampaignWriter.resume(writer.path, HEADER)
    Campaign.open(writer.path).check()


def test_a_run_that_an_interruption_cut_off_is_not_missed_later(writer: CampaignWriter) -> None:
    listed = writer.path / MANIFEST_FILE
    listed.write_text(listed.read_text() + "".join(f"{'0' * 64}  {table}.parquet/b.parquet\n" for table in TABLES))
    writer.append(make_run("c", started_s=1.0))
    assert Campaign.open(writer.path).check().run_ids == ["a", "c"]


@pytest.mark.parametrize(
    "content", [None, b"", b"12ab", b"\x8f\x02\x00k\xff\x90", b"\xfe\n" * 40, b"colour = 1\n"], ids=repr
)
def test_a_list_that_is_damaged_or_lost_is_refused_on_reading_and_on_resuming(
    content: bytes | None, writer: CampaignWriter
) -> None:
    writer.write_table("planned", pd.DataFrame({"run_id": ["a"]}))  # as agvbench bench does
    listed = writer.path / MANIFEST_FILE
    listed.unlink() if content is None else listed.write_bytes(content)
    for use in (lambda: Campaign.open(writer.path), lambda: CampaignWriter.resume(writer.path, HEADER)):
        with pytest.raises(CampaignError, match=rf"^{listed}: [^\n]+; restore it from a copy, or list the files again"):
            use()
    page = (Path(__file__).parents[2] / "docs/reference/campaign-directory.md").read_text(encoding="utf-8")
    (command,) = (line for line in page.splitlines() if line.startswith("find "))
    subprocess.run(["sh", "-c", command], cwd=writer.path, check=True)
    CampaignWriter.resume(writer.path, HEADER)
    Campaign.open(writer.path).check()
