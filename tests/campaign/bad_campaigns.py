"""Campaigns that cannot be read or written: one function per case, each raising its one-line error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from campaign_samples import HEADER, head, make_run, tables, write_campaign, write_csv, write_head
from motion_samples import Change, bench, reversed_in_time, write

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.vehicle.channels import Channels

HERE = Path("c")
Cases = dict[str, tuple[str, Callable[[], object]]]


def _open() -> None:
    Campaign.open(HERE).check()


def _cell(table: str, column: str, row: int, value: Any) -> Callable[[], None]:
    """Open a sound campaign but for one cell."""

    def run() -> None:
        columns = tables()
        columns[table][column][row] = value
        write_campaign(HERE, columns)
        _open()

    return run


def _column(table: str, **changes: list[Any] | None) -> Callable[[], None]:
    """Open a sound campaign but for some columns; None deletes one."""

    def run() -> None:
        columns = tables()
        for name, values in changes.items():
            columns[table].pop(name, None)
            if values is not None:
                columns[table][name] = values
        write_campaign(HERE, columns)
        _open()

    return run


def _head(key: str, value: object, table: str | None = None) -> Callable[[], None]:
    """Open a sound campaign but for one key of its head; None deletes it."""

    def run() -> None:
        write_campaign(HERE)
        toml = head()
        place = toml[table] if table else toml
        place.pop(key)
        if value is not None:
            place[key] = value
        write_head(HERE, toml)
        _open()

    return run


def _file(name: str, change: Callable[[Path], object]) -> Callable[[], None]:
    """Open a sound campaign after something happened to one file."""

    def run() -> None:
        write_campaign(HERE)
        change(HERE / name)
        _open()

    return run


def _moved(change: Change, speed_mps: float = 0.3, *, free: bool = False) -> Callable[[], None]:
    """Open a campaign of a vehicle that drives, but for its poses."""

    def run() -> None:
        sound = bench(speed_mps, free=free)
        write(HERE, sound | {"poses": change(sound["poses"])})
        _open()

    return run


def _cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


def _scratch(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[4:200] = bytes(196)
    path.write_bytes(data)


def _poses_csv(text: Callable[[str], bytes]) -> Callable[[], None]:
    def change(path: Path) -> None:
        path.unlink()
        csv = write_csv(HERE / "poses.csv", tables()["poses"])
        csv.write_bytes(text(csv.read_text()))

    return _file("poses.parquet", change)


def _empty() -> None:
    write_campaign(HERE, {name: {column: [] for column in table} for name, table in tables().items()})
    _open()


def _parts_disagree() -> None:
    write_head(HERE)
    for name, columns in tables().items():
        (HERE / f"{name}.parquet").mkdir()
        for part, extra in (("1", 1.0), ("2", "one")):
            rows = slice(0, 1) if part == "1" else slice(1, None)
            values = {column: values[rows] for column, values in columns.items()}
            values["extra"] = [extra] * len(values["run_id"])
            pq.write_table(pa.table(values), HERE / f"{name}.parquet" / f"{part}.parquet")
    _open()


def _too_many_rows() -> None:
    write_campaign(HERE)
    read_parquet(HERE / "poses.parquet", max_rows=5)


def _changed() -> None:
    CampaignWriter.create(HERE, HEADER).append(make_run("a"))
    _scratch(HERE / "poses.parquet" / "a.parquet")
    _open()


def _lost() -> None:
    CampaignWriter.create(HERE, HEADER).append(make_run("a"))
    (HERE / "poses.parquet" / "a.parquet").unlink()
    _open()


def _list_damaged() -> None:
    CampaignWriter.create(HERE, HEADER).append(make_run("a"))
    (HERE / "SHA256SUMS").write_text("no hash\n")
    _open()


def _unknown_run() -> None:
    Campaign.open(write_campaign(HERE)).run("z")


def _create_twice() -> None:
    CampaignWriter.create(HERE, HEADER)
    CampaignWriter.create(HERE, HEADER)


def _resume_otherwise() -> None:
    CampaignWriter.create(HERE, HEADER)
    CampaignWriter.resume(HERE, replace(HEADER, channels=Channels.alike("us", 1490.0)))


def _resume_files() -> None:
    CampaignWriter.resume(write_campaign(HERE), HEADER)


def _append(*run_ids: str, **changes: Any) -> Callable[[], None]:
    def run() -> None:
        writer = CampaignWriter.create(HERE, HEADER)
        for run_id in run_ids:
            writer.append(make_run(run_id, **changes))

    return run


def _reserved_table() -> None:
    import pandas as pd

    CampaignWriter.create(HERE, HEADER).write_table("poses", pd.DataFrame({"t_s": [1.0]}))


CASES: Cases = {
    "campaign-absent": ("a campaign directory that does not exist", _open),
    "campaign-is-a-file": ("a file instead of a campaign directory", lambda: (HERE.write_text("x"), _open())),
    "head-absent": ("no `campaign.toml`", _file("campaign.toml", Path.unlink)),
    "head-not-toml": (
        "a line of `campaign.toml` that is not TOML",
        _file("campaign.toml", lambda p: p.write_text("schema == 1")),
    ),
    "head-not-text": (
        "a `campaign.toml` of bytes that are not UTF-8",
        _file("campaign.toml", lambda p: p.write_bytes(b"\xff\xfe\x00")),
    ),
    "head-too-large": ("a `campaign.toml` of 2 MB", _file("campaign.toml", lambda p: p.write_bytes(b"#" * (2 << 20)))),
    "head-without-schema": ("no `schema`", _head("schema", None)),
    "head-of-the-future": ("`schema = 5`", _head("schema", 5)),
    "head-schema-zero": ("`schema = 0`", _head("schema", 0)),
    "head-lacks-key": ("no `vehicle.front_axle_m`", _head("front_axle_m", None, "vehicle")),
    "head-wrong-type": ("text where a number belongs", _head("rear_axle_m", "9 cm", "vehicle")),
    "head-unknown-unit": ('`command_unit = "volt"`', _head("command_unit", "volt", "vehicle")),
    "head-rate-negative": ("`mocap.rate_hz = -120.0`", _head("rate_hz", -120.0, "mocap")),
    "head-no-wheelbase": ("axle distances with a negative sum", _head("front_axle_m", -0.1, "vehicle")),
    "head-nan": ("`neutral = nan`", _head("neutral", math.nan, "vehicle")),
    "table-absent": ("no commands table", _file("commands.parquet", Path.unlink)),
    "table-twice": ("`poses.parquet` and `poses.csv`", _file("poses.csv", lambda p: p.write_text("run_id\n"))),
    "column-absent": ("no column `tracked`", _column("poses", tracked=None)),
    "column-misspelt": ("`heading` instead of `heading_rad`", _column("poses", heading_rad=None, heading=[0.0] * 6)),
    "column-of-text": ("text in a column of numbers", _column("commands", drive=["1900", "1500", "fast", "1500"])),
    "column-of-lists": ("lists in a column of numbers", _column("commands", drive=[[1.0]] * 4)),
    "ids-of-floats": ("run ids that are floating point numbers", _column("runs", run_id=[1.0, 2.0])),
    "parquet-cut-off": ("a parquet file without its end", _file("poses.parquet", _cut_off)),
    "parquet-is-not": (
        "a file named `.parquet` that is not",
        _file("poses.parquet", lambda p: p.write_text("run_id,t_s\n")),
    ),
    "parquet-empty": ("a parquet file of 0 bytes", _file("poses.parquet", lambda p: p.write_bytes(b""))),
    "parquet-damaged": ("parquet pages overwritten with zeros", _file("poses.parquet", _scratch)),
    "file-changed": ("a recorded file that was overwritten in part", _changed),
    "file-lost": ("a recorded file that was deleted", _lost),
    "hashes-damaged": ("a line of `SHA256SUMS` without a hash", _list_damaged),
    "parquet-too-long": ("more rows than the limit (lowered to 5 here)", _too_many_rows),
    "parts-disagree": ("an extra column that is a number in one part and text in another", _parts_disagree),
    "csv-semicolons": ("CSV separated by semicolons", _poses_csv(lambda t: t.replace(",", ";").encode())),
    "csv-tabs": ("CSV separated by tabs", _poses_csv(lambda t: t.replace(",", "\t").encode())),
    "csv-utf-16": ("CSV in UTF-16", _poses_csv(lambda t: t.encode("utf-16"))),
    "csv-decimal-comma": (
        "numbers with a decimal comma",
        _poses_csv(lambda t: t.replace("0.1,", '"0,1",', 1).encode()),
    ),
    "csv-ragged": ("a CSV row with a cell too few", _poses_csv(lambda t: t.replace("b,0.0,", "b,", 1).encode())),
    "csv-of-nothing": ("an empty CSV", _poses_csv(lambda _: b"")),
    "csv-column-twice": ("two CSV columns of one name", _poses_csv(lambda t: t.replace("y_m", "x_m", 1).encode())),
    "csv-flag": (
        "a truth value that is neither true nor false",
        _poses_csv(lambda t: t.replace("True", "maybe", 1).encode()),
    ),
    "no-runs": ("tables without rows", _empty),
    "run-without-id": ("an empty run id", _cell("runs", "run_id", 1, "")),
    "run-id-missing": ("a run id that is null", _cell("runs", "run_id", 1, None)),
    "run-twice": ("two runs with one id", _cell("runs", "run_id", 1, "a")),
    "run-status": ('status `"fine"`', _cell("runs", "status", 0, "fine")),
    "run-repeat-negative": ("repeat −1", _cell("runs", "repeat", 0, -1)),
    "run-repeat-fraction": ("repeat 1.5", _cell("runs", "repeat", 0, 1.5)),
    "run-start": ("a start that is NaN", _cell("runs", "started_s", 1, math.nan)),
    "run-target-half": ("a target without a heading", _cell("runs", "target_heading_rad", 0, math.nan)),
    "run-target-infinite": ("an infinite target", _cell("runs", "target_x_m", 0, math.inf)),
    "run-split": ('split `"test"`', _column("runs", split=["fit", "test"])),
    "commands-none": ("a run without commands", _column("commands", run_id=["a"] * 4, t_s=[0.0, 1.0, 2.0, 3.0])),
    "commands-nan": ("NaN in a command", _cell("commands", "front", 1, math.nan)),
    "commands-infinite": ("an infinite command", _cell("commands", "rear", 3, math.inf)),
    "commands-backwards": ("commands whose time goes backwards", _cell("commands", "t_s", 1, -0.5)),
    "commands-doubled": ("two commands at one time", _cell("commands", "t_s", 3, 0.0)),
    "commands-unit": ("commands of −1…1 in a campaign in µs", _cell("commands", "drive", 0, 0.4)),
    "commands-clock": (
        "a run whose first command is at 1726473661 s",
        _column("commands", t_s=[1726473661.0, 1726473662.0, 0.0, 1.0]),
    ),
    "poses-unknown-run": ("poses of a run that is not listed", _cell("poses", "run_id", 4, "z")),
    "poses-none": ("a run with status ok and no poses", _column("poses", run_id=["a"] * 6)),
    "poses-time-nan": ("a pose without a time", _cell("poses", "t_s", 5, math.nan)),
    "poses-infinite": ("an infinite position that is marked as tracked", _cell("poses", "x_m", 1, math.inf)),
    "poses-clock": ("poses in another clock than the commands", _column("poses", t_s=[1e9 + t for t in range(6)])),
    "poses-degrees": ("headings in degrees", _column("poses", heading_rad=[120.0, 121.0, 122.0] * 2)),
    "poses-degrees-wrap": (
        "headings in degrees that pass 180",
        _column("poses", heading_rad=[0.0, 90.0, 179.5, -179.5, 5.0, 6.0], run_id=["a"] * 5 + ["b"]),
    ),
    "poses-millimetres": ("positions in millimetres", _column("poses", x_m=[1000.0, 1100.0, 1200.0] * 2)),
    "poses-centimetres": (
        "positions in centimetres: vehicles drive at most 20 m/s and 100 wheelbases a second",
        _moved(lambda poses: poses.assign(x_m=100.0 * poses.x_m, y_m=100.0 * poses.y_m)),
    ),
    "poses-centimetres-slow": (
        "positions in centimetres of a slow vehicle that had targets",
        _moved(lambda poses: poses.assign(x_m=100.0 * poses.x_m, y_m=100.0 * poses.y_m), 0.05),
    ),
    "poses-degrees-of-turns": (
        "headings in degrees that begin near 0",
        _moved(lambda poses: poses.assign(heading_rad=np.degrees(poses.heading_rad))),
    ),
    "poses-reversed": ("poses in reversed time, of runs that had targets", _moved(reversed_in_time)),
    "poses-reversed-free": (
        "poses in reversed time, of runs with varied commands",
        _moved(reversed_in_time, free=True),
    ),
    "run-unknown": ("a request for an unknown run", _unknown_run),
    "create-over": ("a new campaign in the directory of another one", _create_twice),
    "resume-otherwise": ("resuming with another vehicle", _resume_otherwise),
    "resume-files": ("resuming a campaign of single files", _resume_files),
    "append-twice": ("appending two runs with one id", _append("a", "a")),
    "append-no-id": ("appending a run without an id", _append("")),
    "append-known-column": ("an extra column with the name of a known one", _append("a", extra={"status": "x"})),
    "table-reserved": ("writing `poses` as a further table", _reserved_table),
}
