"""Recordings and mappings that cannot be imported: one function per case, each raising its one-line error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from bad_campaigns import Cases
from campaign_samples import MAPPING, recording, write_csv

from agvbench.campaign import import_recordings


def _import(mapping: str = MAPPING, *, files: tuple[str, ...] = ("r.csv",), **changes: list[Any] | None) -> None:
    columns = recording()
    for name, values in changes.items():
        columns.pop(name)
        if values is not None:
            columns[name] = values
    write_csv(Path("r.csv"), columns)
    Path("mapping.toml").write_text(mapping)
    import_recordings("mapping.toml", files, "c")


def _mapping(old: str, new: str) -> Callable[[], None]:
    assert old in MAPPING
    return lambda: _import(MAPPING.replace(old, new))


def _logged(lines: str, **changes: list[Any] | None) -> Callable[[], None]:
    return lambda: _import(f"{MAPPING}[logged]\n{lines}\n", **changes)


def _cell(column: str, row: int, value: object) -> Callable[[], None]:
    values = recording()[column]
    values[row] = value
    return lambda: _import(**{column: values})


def _text(change: Callable[[bytes], bytes], mapping: str = MAPPING) -> Callable[[], None]:
    def run() -> None:
        path = write_csv(Path("changed.csv"), recording())
        path.write_bytes(change(path.read_bytes()))
        _import(mapping, files=("changed.csv",))

    return run


def _over_something() -> None:
    Path("c").mkdir()
    Path("c/notes.txt").write_text("mine")
    _import()


def _one_name_twice() -> None:
    Path("monday").mkdir()
    write_csv(Path("monday/r.csv"), recording())
    _import(files=("r.csv", "monday/r.csv"))


_ISO = MAPPING.replace('unit = "ms"', 'unit = "iso8601"')
_QUATERNION = 'quaternion = { x = "X", y = "X", z = "X", w = "X", floor_x = "z", floor_y = "-z" }'
_GATE = "[gate]\nmax_speed_m_per_s = 1.0\nmax_yaw_rate_rad_per_s = -5.0\n"

CASES: Cases = {
    "recording-times-coarse": (
        "times of poses rounded to a tenth of a second",
        lambda: _import(t=[100 * round(row / 10) for row in range(60)]),
    ),
    "mapping-absent": (
        "a mapping that is neither a file nor built in",
        lambda: import_recordings("drat", ["r.csv"], "c"),
    ),
    "mapping-not-toml": ("a mapping that is not TOML", lambda: _import("schema: 1")),
    "mapping-future": ("a mapping of `schema = 2`", _mapping("schema = 1", "schema = 2")),
    "mapping-key-unknown": ("a misspelt key", _mapping("gap_s", "gaps_s")),
    "mapping-key-missing": ("no `columns.x`", _mapping('x = { column = "X", unit = "mm" }\n', "")),
    "mapping-unit-unknown": ('`unit = "metre"`', _mapping('"X", unit = "mm"', '"X", unit = "metre"')),
    "mapping-unit-missing": ("no unit", _mapping('"X", unit = "mm"', '"X"')),
    "mapping-time-unit": ('`unit = "sec"` for the time', _mapping('unit = "ms"', 'unit = "sec"')),
    "mapping-unit-of-other": ("an angle in mm", _mapping('unit = "deg"', 'unit = "mm"')),
    "mapping-value-type": ("text where a number belongs", _mapping("gap_s = 0.5", 'gap_s = "long"')),
    "mapping-gate-negative": ("a gate of negative yaw rate", _mapping("[runs]", _GATE + "[runs]")),
    "mapping-heading-twice": ("heading and quaternion", _mapping("drive =", _QUATERNION + "\ndrive =")),
    "mapping-floor-axes": (
        "a floor whose x and y are one axis",
        _mapping('heading = { column = "yaw", unit = "deg" }', _QUATERNION),
    ),
    "mapping-wheelbase": ("a wheelbase of 0 m", _mapping("front_axle_m = 0.1", "front_axle_m = -0.1")),
    "mapping-logged-name": (
        "a further column with the name of one of the campaign's own",
        _logged('x_m = { column = "X" }'),
    ),
    "mapping-logged-empty": (
        "a further column without a name",
        _logged('"" = { column = "X" }'),
    ),
    "mapping-logged-many": (
        "65 further columns",
        _logged("\n".join(f'c{k} = {{ column = "X" }}' for k in range(65))),
    ),
    "mapping-logged-key": (
        "a misspelt key of a further column",
        _logged('a = { column = "X" }\nvolts = { colunm = "X" }'),
    ),
    "mapping-logged-scale": (
        "text as the scale of a further column",
        _logged('volts = { column = "X", scale = "2" }'),
    ),
    "recording-logged-overflow": (
        "a further column whose scale makes a cell infinite",
        _logged('volts = { column = "X", scale = 1e12 }', X=["1e300"] * 60),
    ),
    "mapping-logged-topic": (
        "a topic of a further column, for a CSV",
        _logged('volts = { column = "X", topic = "/volts" }'),
    ),
    "recording-logged-column": (
        "a further column that the CSV lacks",
        _logged('volts = { column = "volts" }'),
    ),
    "recording-absent": ("a recording that does not exist", lambda: _import(files=("s.csv",))),
    "recording-none": ("no recordings", lambda: _import(files=())),
    "recording-twice": ("two recordings of one name", _one_name_twice),
    "recording-column": ("a mapped column that the CSV lacks", lambda: _import(yaw=None)),
    "recording-cell": ("a cell that is not a number", _cell("X", 6, "n/a")),
    "recording-comma": ("a decimal comma that the mapping does not declare", _cell("X", 2, '"1000,5"')),
    "recording-infinite": ("an infinite cell", _cell("Z", 9, "inf")),
    "recording-backwards": ("time going backwards", _cell("t", 30, 120)),
    "recording-no-time": ("a row without time", _cell("t", 3, "")),
    "recording-iso": ("a time that is not ISO 8601", lambda: _import(_ISO, t=["yesterday"] * 60)),
    "recording-day": ("sessions by day in a clock that starts at 0", _mapping("[runs]", '[runs]\nsession = "day"')),
    "recording-semicolons": ("semicolons that the mapping does not declare", _text(lambda b: b.replace(b",", b";"))),
    "recording-latin-1": ("Latin-1 where UTF-8 is declared", _text(lambda b: b.replace(b"yaw", b"gier\xe4"))),
    "recording-encoding": ("an unknown encoding", lambda: _import(MAPPING + '\n[csv]\nencoding = "utf-9"\n')),
    "recording-encoding-nul": (
        "an encoding whose name has a NUL",
        lambda: _import(MAPPING + '\n[csv]\nencoding = "utf\\u0000-8"\n'),
    ),
    "mapping-delimiter": ("a delimiter that is not ASCII", lambda: _import(MAPPING + '\n[csv]\ndelimiter = "é"\n')),
    "mapping-delimiter-digit": ("a digit as delimiter", lambda: _import(MAPPING + '\n[csv]\ndelimiter = "0"\n')),
    "mapping-skip-rows": (
        "more than 10000 lines before the header (`skip_rows`)",
        lambda: _import(MAPPING + "\n[csv]\nskip_rows = 99999999999\n"),
    ),
    "recording-cell-long": (
        "a quoted cell that contains the rest of the file",
        _cell("X", 6, '"' + 500 * "abcdefghi " + '"'),
    ),
    "recording-not-driven": ("no row that was driven", lambda: _import(armed=[0] * 60)),
    "recording-too-short": (
        "recordings shorter than the shortest run",
        _mapping("shortest_s = 0.2", "shortest_s = 5.0"),
    ),
    "recording-pieces": (
        "a longest run shorter than the interval between poses",
        _mapping("shortest_s = 0.2", "shortest_s = 0.2\nlongest_s = 1e-9"),
    ),
    "recording-no-rows": ("a header without rows", _text(lambda b: b.splitlines()[0] + b"\n")),
    "recording-no-end": ("a header without the end of its line", _text(lambda b: b.splitlines()[0])),
    "recording-unit": ("commands of −1…1 where µs are declared", lambda: _import(throttle=[0.5] * 60)),
    "out-not-empty": ("an output directory that is not empty", _over_something),
}
