"""Every line of docs/reference/errors-reports.md, word for word."""

import re
import resource
from pathlib import Path

import pytest
from report_samples import make_campaign, make_free_campaign

from agvbench.cli import main

DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "errors-reports.md"
CASES = re.findall(r"^\| `([a-z0-9-]+)` \| `([^`]*)` \| `([^`]*)` \|$", DOCUMENT.read_text(encoding="utf-8"), re.M)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("lab")
    make = {"repeats": 1, "rate_hz": 30.0, "conditions": ("calibrated",), "calibration": False}
    make_campaign(path / "c", trajectories=("1_forward", "6_forward_right"), **make)
    make_campaign(path / "other", trajectories=("2_backward",), **make)
    make_campaign(path / "rejected", trajectories=("5_forward_left",), **make)
    make_free_campaign(path / "free")
    (path / "empty").mkdir()
    (path / "a_file").write_text("", encoding="utf-8")
    return path


def test_the_table_is_read():
    assert len(CASES) >= 12
    assert len({name for name, _, _ in CASES}) == len(CASES)


@pytest.mark.parametrize(("arguments", "line"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_bad_input_is_one_line(arguments, line, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    command, *rest = arguments.split()
    assert main([command, *rest]) == 2
    said = capsys.readouterr()
    assert said.err == f"agvbench {command}: {line}\n"


def test_a_disk_that_is_full_when_the_recording_is_written_is_one_line(folder, tmp_path, capsys):
    (tmp_path / "campaign.rrd").symlink_to("/dev/full")
    assert main(["report", str(folder / "c"), "--out", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"agvbench report: {tmp_path / 'campaign.rrd'}: cannot be written (")
    assert "No space left on device" in line


def test_a_disk_that_is_full_leaves_no_empty_files_and_folders_and_an_earlier_report_as_it_was(folder, tmp_path):
    (tmp_path / "report.html").write_text("of last week")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, limits[1]))
    try:
        for out in (tmp_path, tmp_path / "new" / "report"):
            assert main(["report", str(folder / "c"), "--out", str(out)]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.rglob("*")] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "of last week"
