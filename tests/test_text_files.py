"""Files of text: what is too long, or nested too deep for a parser's stack, is one line for every reader."""

from __future__ import annotations

import os
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agvbench.adapters.natnet.capture import datagrams_of
from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.manifest import Manifest
from agvbench.campaign.recordings.mapping import load_mapping
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.errors import AgvbenchError, FileError
from agvbench.model import VehicleModel
from agvbench.planning.trajectories.loading import load_trajectory
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.session.end_pose_bias import read_bias_corrections
from agvbench.text_files import MAX_BYTES, MAX_DEPTH, read_json, read_text, read_toml

READERS: dict[str, Callable[[Path], object]] = {
    "vehicle.toml": VehicleModel.load,
    "trajectory.toml": load_trajectory,
    "campaign.toml": CampaignHeader.load,
    "mapping.toml": load_mapping,
    "remainders.json": lambda path: read_bias_corrections(str(path)),
    "bench.toml": lambda path: BenchSettings.load(path.parent),
}
FURTHER: dict[str, Callable[[Path], object]] = {
    "recording.csv": read_csv_text,
    "poses.parquet": read_parquet,
    "SHA256SUMS": lambda path: Manifest(path.parent),
    "stream.pcap": lambda path: list(datagrams_of(path)),
}
TOO_MUCH = {
    "too long": "#" * (MAX_BYTES + 1),
    "nested too deep": "a = " + "[" * 5000 + "]" * 5000,
}


@pytest.mark.parametrize("what", TOO_MUCH)
@pytest.mark.parametrize("name", READERS)
def test_every_reader_refuses_what_is_too_much(name: str, what: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(TOO_MUCH[what])
    with pytest.raises(AgvbenchError, match=r"is too l|is nested too deep") as caught:
        READERS[name](path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Path]:
    """A pipe with somebody who would write to it, so that reading it ends."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=lambda: path.open("wb").close())
    writer.start()
    yield path
    while writer.is_alive():
        os.close(os.open(path, os.O_RDONLY | os.O_NONBLOCK))
        writer.join(0.01)


@pytest.mark.parametrize("name", [*READERS, *FURTHER])
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_every_reader_refuses_pipes_and_devices(name: str, kind: str, pipe: Path, tmp_path: Path) -> None:
    path = tmp_path / name
    path.symlink_to(pipe if kind == "pipe" else "/dev/null")
    with pytest.raises(AgvbenchError, match=r": (is a pipe or a device|is neither a file nor a mapping)") as caught:
        (READERS | FURTHER)[name](path)
    assert "\n" not in str(caught.value)


def test_dotted_keys_nest_too(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(".".join("a" * (MAX_DEPTH + 1)) + " = 1")
    with pytest.raises(FileError, match="is nested too deep"):
        read_toml(path)
    path.write_text(".".join("a" * 50) + " = 1")
    assert read_toml(path)


@pytest.mark.parametrize("part", ["a", "'a'", '"a\\"b"', "a "])
def test_a_long_dotted_key_is_refused_before_the_parser_takes_memory_for_it(part: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(".".join([part] * 3_000) + " = 1")
    tracemalloc.start()
    with pytest.raises(FileError, match="is nested too deep"):
        read_toml(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5e6


def test_dots_elsewhere_are_no_depth(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f"a = [{', '.join(['0.125'] * 500)}]\nb = '{'. '.join(['Word word'] * 300)}'\n")
    assert len(read_toml(path)["a"]) == 500


@pytest.mark.parametrize(("name", "form"), [("a.toml", "a = {}"), ("a.json", "[{}]")])
def test_an_integer_of_too_many_digits_is_one_line(name: str, form: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(form.format("1" * 5000))
    with pytest.raises(FileError, match=r"has an integer that is too long \(limit: 4300 digits\)"):
        (read_toml if name.endswith(".toml") else read_json)(path)


def test_many_brackets_side_by_side_are_no_depth(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("[" + ",".join("[1]" for _ in range(1000)) + "]")
    assert len(read_json(path)) == 1000
    assert read_text(path, max_bytes=10_000)
    with pytest.raises(FileError, match="is too long"):
        read_text(path, max_bytes=1000)
