from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_samples import head, tables, write_campaign, write_csv, write_head

from agvbench.campaign import Campaign
from agvbench.campaign.tables.schema import TABLES


def test_csv_reads_as_parquet_does(tmp_path: Path) -> None:
    campaign = write_campaign(tmp_path / "parquet")
    write_head(tmp_path / "csv")
    for name, columns in tables().items():
        write_csv(tmp_path / "csv" / f"{name}.csv", columns, encoding="utf-8-sig")
    one, other = Campaign.open(campaign), Campaign.open(tmp_path / "csv")
    for table in ("runs", "commands", "poses"):
        assert getattr(one, table).equals(getattr(other, table))


def test_parts_of_another_program_read_too_and_may_differ_in_columns(tmp_path: Path) -> None:
    write_head(tmp_path)
    for name, columns in tables().items():
        (tmp_path / f"{name}.parquet").mkdir()
        for run_id in "ab":
            rows = [row for row, value in enumerate(columns["run_id"]) if value == run_id]
            part = {column: [values[row] for row in rows] for column, values in columns.items()}
            if run_id == "b":
                part |= {"wheel_temperature_degc": [20.0] * len(rows)}
            pq.write_table(pa.table(part), tmp_path / f"{name}.parquet" / f"part-{ord('z') - ord(run_id)}.parquet")
    campaign = Campaign.open(tmp_path).check()
    assert campaign.run_ids == ["a", "b"]
    np.testing.assert_array_equal(campaign.run("b").frames.x_m, [1.0, 1.1, 1.2])
    assert campaign.run("b").extra == {"wheel_temperature_degc": 20.0}
    assert campaign.poses["wheel_temperature_degc"].isna().tolist() == [True] * 3 + [False] * 3


def test_unknown_columns_are_kept_and_integer_ids_are_text(tmp_path: Path) -> None:
    columns = tables()
    numbers = {"a": 7, "b": 8}
    for table in columns.values():
        table["run_id"] = [numbers[run_id] for run_id in table["run_id"]]
    columns["runs"]["battery_v"] = [7.4, 7.2]
    columns["commands"]["note"] = ["x"] * 4
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns))
    assert campaign.run("8").extra == {"battery_v": 7.2}
    assert campaign.commands["note"].tolist() == ["x"] * 4


def test_runs_are_ordered_by_time_and_rows_are_gathered(tmp_path: Path) -> None:
    columns = tables()
    columns["runs"]["started_s"] = [10.0, 0.0]
    order = [0, 3, 1, 4, 2, 5]
    columns["poses"] = {name: [values[row] for row in order] for name, values in columns["poses"].items()}
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns))
    assert campaign.run_ids == ["b", "a"]
    np.testing.assert_array_equal(campaign.run("a").frames.x_m, [0.0, 0.1, 0.2])
    assert campaign.poses["run_id"].tolist() == ["b"] * 3 + ["a"] * 3


def test_what_real_cameras_do_is_accepted(tmp_path: Path) -> None:
    columns = tables()
    poses = columns["poses"]
    poses["t_s"] = [-0.2, 0.5, 0.5, 0.4, 0.7, 0.6]  # before the start, doubled, late
    poses["x_m"] = [0.0, math.nan, 40.0, None, 0.0, 0.0]  # lost, wild, missing
    poses["heading_rad"] = [3.1, 3.1 - 2 * math.pi, 9.4, 0.0, math.inf, 0.0]
    poses["tracked"] = [True, True, True, True, False, True]
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns)).check()
    frames = campaign.run("a").frames
    assert frames.tracked.tolist() == [True, False, True]
    np.testing.assert_array_equal(frames.x_m, [0.0, math.nan, 40.0])
    np.testing.assert_array_equal(frames.t_s, [-0.2, 0.5, 0.5])
    lost = campaign.run("b").frames
    assert lost.tracked.tolist() == [False, False, True]
    assert np.isnan(lost.heading_rad[:2]).all()
    assert campaign.poses["tracked"].sum() == 3


def test_an_aborted_run_may_have_nothing(tmp_path: Path) -> None:
    columns = tables()
    columns["runs"]["status"] = ["ok", "aborted: vehicle gone"]
    for name in ("commands", "poses"):
        count = columns[name]["run_id"].count("a")
        columns[name] = {column: values[:count] for column, values in columns[name].items()}
    run = Campaign.open(write_campaign(tmp_path / "c", columns)).run("b")
    assert (len(run.commands), len(run.frames), run.is_ok) == (0, 0, False)


def test_a_heading_that_turns_on_is_not_degrees(tmp_path: Path) -> None:
    columns = tables()
    rows = 6000
    columns["poses"] = {
        "run_id": ["a"] * rows + ["b"],
        "t_s": [*(np.arange(rows) / 10.0), 0.0],
        "x_m": [0.0] * (rows + 1),
        "y_m": [0.0] * (rows + 1),
        "heading_rad": [*(0.75 * np.arange(rows) / 10.0), 0.0],  # unwrapped through 70 turns
        "tracked": [True] * (rows + 1),
    }
    columns["commands"]["t_s"][1] = 600.0
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns)).check()
    assert campaign.run("a").frames.heading_rad.max() > 400.0


def test_select(tmp_path: Path) -> None:
    columns = tables()
    columns["runs"] |= {"split": ["fit", None], "session": ["s1", "s1"], "status": ["ok", "rejected: late"]}
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns))

    def ids(**wanted: object) -> list[str]:
        return [run.run_id for run in campaign.select(**wanted)]  # type: ignore[arg-type]

    assert ids() == ["a"]
    assert ids(ok_only=False) == ["a", "b"]
    assert ids(experiment="drive", ok_only=False) == ["b"]
    assert ids(experiment=("drive", "trajectory"), condition="calibrated") == ["a"]
    assert ids(split="fit", session="s1") == ["a"]
    assert ids(trajectory="9") == []
    assert campaign.run("b").split is None


@pytest.mark.parametrize("prediction", [None, {"horizon_s": 1.0}, {"horizon_s": 1.0, "stride_s": 0.5}])
def test_the_head_survives(tmp_path: Path, prediction: dict[str, float] | None) -> None:
    table = head() | ({"prediction": prediction} if prediction else {}) | {"lab": {"room": "E-1"}}
    header = Campaign.open(_with_head(tmp_path, table)).header
    expected = prediction or {}
    assert header.prediction_horizon_s == expected.get("horizon_s")
    assert header.prediction_stride_s == expected.get("stride_s", expected.get("horizon_s"))
    header.save(tmp_path / "campaign.toml")
    assert Campaign.open(tmp_path).header == header


def _with_head(directory: Path, table: dict[str, object]) -> Path:
    write_campaign(directory)
    return write_head(directory, table)


def test_a_campaign_of_nothing_but_aborted_runs_opens(tmp_path: Path) -> None:
    columns = tables()
    columns["runs"]["status"] = ["aborted: no vehicle"] * 2
    columns |= {name: {column: [] for column in columns[name]} for name in ("commands", "poses")}
    campaign = Campaign.open(write_campaign(tmp_path / "c", columns)).check()
    assert [len(run.frames) for run in campaign] == [0, 0]
    assert campaign.select() == []


_PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "campaign-directory.md"


def test_the_reference_shows_a_head_that_loads_and_names_every_column(tmp_path: Path) -> None:
    page = _PAGE.read_text(encoding="utf-8")
    block = page.split("```toml\n")[1].split("```")[0]
    write_campaign(tmp_path)
    (tmp_path / "campaign.toml").write_text(block, encoding="utf-8")
    assert Campaign.open(tmp_path).header.prediction_stride_s == 0.5
    missing = [c.name for table in TABLES.values() for c in table if f"`{c.name}`" not in page]
    assert missing == []


def test_a_clock_that_is_moved_takes_the_times_of_arrival_with_it(tmp_path):
    """A first command at 30 s is time zero: a frame that took 20 ms to arrive still does."""
    columns = tables()
    for name in ("commands", "poses"):
        columns[name]["t_s"] = [30.0 + t_s for t_s in columns[name]["t_s"]]
    columns["poses"]["received_s"] = [t_s + 0.02 for t_s in columns["poses"]["t_s"]]
    for run in Campaign.open(write_campaign(tmp_path / "c", columns)):
        assert run.frames.t_s[0] == 0.0
        np.testing.assert_allclose(run.frames.received_s - run.frames.t_s, 0.02, atol=1e-9)
