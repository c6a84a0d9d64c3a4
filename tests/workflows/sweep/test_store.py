"""What a sweep records survives an interruption, and its tables do not depend on the order of cells."""

from __future__ import annotations

import itertools

import msgspec
import pyarrow.parquet as pq
import pytest

from agvbench.errors import FileError
from agvbench.workflows.sweep.axes import Axis
from agvbench.workflows.sweep.cell import MARK, CellResult, Cost, Row
from agvbench.workflows.sweep.grid import Grid
from agvbench.workflows.sweep.results import ranked_cells, read_results, write_results
from agvbench.workflows.sweep.store import CellStore, Header, Line, header

FIRST = header("a" * 64, "", diagnose=False)
GRID = Grid(("trajectories",), {}, (Axis("seed", "", range(3)), Axis("plant_option", "grip", (0.5, 1))))


def result(cell: int, condition: str = "calibrated", **medians: float) -> CellResult:
    rows = (Row("1", condition, 3, {"position_error_mm": 10.0 - cell, **medians}), Row("5", condition, 2, {}))
    return CellResult(cell != 4, f"{cell:064d}", rows, Cost(float(cell), 1.0, 2, 3), "NAMED", ("steering_lag", "x"))


def store_of(folder, cells):
    folder.mkdir()
    store = CellStore.create(folder, FIRST)
    for cell in cells:
        store.add(Line(cell, result(cell, heading_error_deg=0.5) if cell else result(cell)))
    return store


def test_the_tables_do_not_depend_on_the_order_in_which_cells_end(tmp_path):
    found = set()
    for n, order in enumerate(itertools.islice(itertools.permutations(range(6)), 0, 720, 111)):
        folder = tmp_path / str(n)
        paths = write_results(folder, GRID, store_of(folder, order), diagnose=True)
        found.add(tuple(path.read_bytes() for path in paths))
    assert len(found) == 1
    frame = read_results(tmp_path / "0")
    assert list(frame.columns) == [
        "cell", "seed", "plant_option.grip", "trajectory", "condition", "n", "complete",
        "heading_error_deg", "position_error_mm", "verdict", "named", "sha256",
    ]  # fmt: skip
    assert frame["cell"].tolist() == [n for n in range(6) for _ in range(2)]
    assert frame.loc[frame["cell"] == 3, ["seed", "plant_option.grip"]].to_numpy().tolist() == [[1, 1.0]] * 2
    assert frame.loc[frame["cell"] == 4, "complete"].tolist() == [False, False]
    assert set(frame["named"]) == {"steering_lag, x"}
    assert ranked_cells(tmp_path / "0", GRID)["cell"].tolist() == [5, 4, 3, 2, 1, 0]
    assert ranked_cells(tmp_path / "0", GRID)["n"].tolist() == [3] * 6
    conditions = frame["condition"].unique().tolist()
    assert list(ranked_cells(tmp_path / "0", GRID).columns) == ["cell", "seed", "plant_option.grip", "n", *conditions]


def test_a_cell_without_runs_has_a_row(tmp_path):
    store = store_of(tmp_path / "s", [])
    store.add(Line(2, CellResult(True, "0" * 64, (), Cost(1.0, 1.0, 1, 1))))
    write_results(tmp_path / "s", GRID, store, diagnose=False)
    frame = read_results(tmp_path / "s")
    assert frame[["cell", "trajectory", "n"]].to_numpy().tolist() == [[2, "", 0]]
    assert ranked_cells(tmp_path / "s", GRID).empty


@pytest.mark.parametrize("cut", [1, 2, 40, 150])
def test_a_line_that_was_cut_off_is_dropped_and_written_over(tmp_path, cut):
    folder = tmp_path / "s"
    store_of(folder, [0, 1, 2]).close()
    whole = (folder / MARK).read_bytes()
    (folder / MARK).write_bytes(whole[:-cut])
    store = CellStore.resume(folder, FIRST, 6)
    assert sorted(store.places) == [0, 1]
    store.add(Line(2, result(2, heading_error_deg=0.5)))
    assert (folder / MARK).read_bytes() == whole
    assert [cell for cell, _ in store.results()] == [0, 1, 2]


def test_failures_are_known_until_the_cell_has_a_result_and_the_newest_line_counts(tmp_path):
    folder = tmp_path / "s"
    store = store_of(folder, [0])
    store.add(Line(1, error="the disk is full"))
    store.add(Line(3, error="killed"))
    store.add(Line(3, result(3)))
    assert store.failed == {1: "the disk is full"}
    store.close()
    again = CellStore.resume(folder, FIRST, 6)
    assert again.failed == {1: "the disk is full"}
    assert sorted(again.places) == [0, 3]
    assert dict(again.results())[3] == result(3)


@pytest.mark.parametrize(
    ("field", "value", "line"),
    [
        ("grid", "b" * 64, "is of another grid: aaaaaaaaaaaa (limit: bbbbbbbbbbbb)"),
        ("agvbench", "9.9", "was begun with another version of agvbench: "),
        ("files", "c" * 64, "was begun with other files in this folder: "),
        ("diagnose", True, "was begun with another --diagnose: False (limit: True)"),
        ("schema", 9, "has another schema: 1 (limit: 9)"),
    ],
)
def test_another_sweep_is_not_resumed(tmp_path, field, value, line):
    store_of(tmp_path / "s", [0]).close()
    other = Header(**{**msgspec.structs.asdict(FIRST), field: value})
    with pytest.raises(FileError) as caught:
        CellStore.resume(tmp_path / "s", other, 6)
    assert f"{MARK}: {line}" in str(caught.value)
    assert str(caught.value).endswith("begin anew without --resume, in another directory")


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        (lambda text: b"", "no sweep to resume: its first line is missing"),
        (lambda text: b"{}\n" + text, "byte 0: holds no sweep to resume: "),
        (lambda text: text + b'{"cell":"one"}\n', "holds no sweep to resume: Expected `int`, got `str`"),
        (lambda text: text + b'{"cell":6,"error":"x"}\n', "has a cell that the grid lacks: 6"),
        (lambda text: text + b'{"cell":1,"result":{"rows":[]}}\n', "holds no sweep to resume: Object missing required"),
        (lambda text: text + b"\xff\n", "holds no sweep to resume: "),
        (lambda text: text + b" " * (5 << 20), "has a line that is too long (limit: 4194304 bytes)"),
    ],
)
def test_a_file_that_is_no_record_of_a_sweep_is_one_line_and_stays(tmp_path, damage, line):
    store_of(tmp_path / "s", [0]).close()
    path = tmp_path / "s" / MARK
    path.write_bytes(damage(path.read_bytes()))
    before = path.read_bytes()
    with pytest.raises(FileError) as caught:
        CellStore.resume(tmp_path / "s", FIRST, 6)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_a_sweep_without_a_record_is_none_to_resume(tmp_path):
    with pytest.raises(FileError, match="no sweep to resume; leave out --resume"):
        CellStore.resume(tmp_path, FIRST, 6)


def test_many_cells_are_written_in_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("agvbench.workflows.sweep.results._ROWS", 4)
    store = store_of(tmp_path / "s", range(6))
    parquet, csv = write_results(tmp_path / "s", GRID, store, diagnose=False)
    assert pq.ParquetFile(parquet).metadata.num_row_groups == 3
    assert len(csv.read_text().splitlines()) == 13
