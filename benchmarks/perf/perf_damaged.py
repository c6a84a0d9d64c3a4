"""What becomes of damaged recordings: one clear line, or the right answer, and never a traceback or a wrong unit.

A recording is replayed by fitted static maps with a steering lag of 0.15 s (see `perf_replayed.py`), written as CSV,
damaged in one of many ways, imported and diagnosed. Printed: for each damage the outcomes, and at the end their counts:
``refused`` with one line, ``right`` (the lag, to 20 %), ``said`` (UNKNOWN or not identifiable), ``wrong``, ``crash``.
Run with ``python benchmarks/perf/perf_damaged.py [--vehicle cpm] [--seeds N] [--first-seed S]``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from perf_replayed import Planted, Source
from rich.console import Console

from agvbench.campaign import import_recordings
from agvbench.diagnosis import diagnose
from agvbench.errors import AgvbenchError

LAG_S, TOLERANCE = 0.15, 0.2
Damage = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


def _part(rows: int, share: float, rng: np.random.Generator) -> slice:
    length = int(share * rows)
    begin = int(rng.integers(0, rows - length))
    return slice(begin, begin + length)


def _set(table: pd.DataFrame, rows: slice | np.ndarray, column: str, values: object) -> pd.DataFrame:
    table.iloc[rows, table.columns.get_loc(column)] = values  # type: ignore[index]
    return table


def missing_rows(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Remove half of the rows."""
    return table[rng.random(len(table)) < 0.5]


def gap(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Remove a tenth of the recording."""
    return table.drop(table.index[_part(len(table), 0.1, rng)])


def empty_poses(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Lose the vehicle in every fifth row."""
    return _set(table, np.flatnonzero(rng.random(len(table)) < 0.2), "x_m", np.nan)


def jump(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Follow something else for a second."""
    own = _part(len(table), 0.02, rng)
    return _set(table, own, "x_m", table["x_m"].iloc[own] + 2.0)


def clock_step(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Advance the clock by three seconds."""
    own = slice(int(rng.integers(0, len(table))), len(table))
    return _set(table, own, "t_s", table["t_s"].iloc[own] + 3.0)


def clock_back(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Put the clock back by three seconds."""
    own = slice(int(rng.integers(200, len(table))), len(table))
    return _set(table, own, "t_s", table["t_s"].iloc[own] - 3.0)


def latched(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Refresh poses in every fourth row only."""
    held = np.arange(len(table)) // 4 * 4
    for name in ("x_m", "y_m", "heading_rad"):
        table[name] = table[name].to_numpy()[held]
    return table


def mirrored(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Reverse the y axis."""
    return table.assign(y_m=-table["y_m"])


def clockwise(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Count headings clockwise."""
    return table.assign(heading_rad=-table["heading_rad"])


def degrees(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give headings in degrees."""
    return table.assign(heading_rad=np.degrees(table["heading_rad"]))


def millimetres(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give positions in millimetres."""
    return table.assign(x_m=1e3 * table["x_m"], y_m=1e3 * table["y_m"])


def milliseconds(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give times in milliseconds."""
    return table.assign(t_s=1e3 * table["t_s"])


def swapped_axes(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Exchange x and y."""
    return table.assign(x_m=table["y_m"], y_m=table["x_m"])


def reversed_steering(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Have positive steering turn right: another vehicle, and no damage."""
    return table.assign(steering=-table["steering"])


def reversed_throttle(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Have positive throttle drive backward: another vehicle, and no damage."""
    return table.assign(throttle=-table["throttle"])


def empty_commands(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Leave both commands out in every fifth row."""
    return table.mask(_every_fifth(table, rng, ("throttle", "steering")))


def words(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Write n/a for a hundredth of the positions."""
    lost = rng.random(len(table)) < 0.01
    return table.assign(x_m=np.where(lost, "n/a", table["x_m"].astype(str)))


def infinite(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give infinite positions in a hundredth of the rows."""
    return _set(table, np.flatnonzero(rng.random(len(table)) < 0.01), "y_m", np.inf)


def repeated_rows(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Write each row twice."""
    return table.loc[table.index.repeat(2)]


def shuffled(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Write the rows in random order."""
    return table.sample(frac=1.0, random_state=int(rng.integers(2**31)))


def swapped_bodies(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Follow another vehicle for a twentieth of the recording: poses of another part of it."""
    own = _part(len(table), 0.05, rng)
    other = (np.arange(len(table))[own] + len(table) // 2) % len(table)
    for name in ("x_m", "y_m", "heading_rad"):
        _set(table, own, name, table[name].to_numpy()[other])
    return table


def centimetres(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give positions in centimetres."""
    return table.assign(x_m=1e2 * table["x_m"], y_m=1e2 * table["y_m"])


def millimetres_later(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give positions in millimetres from the middle on."""
    factor = np.where(np.arange(len(table)) < len(table) // 2, 1.0, 1e3)
    return table.assign(x_m=factor * table["x_m"], y_m=factor * table["y_m"])


def percent(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give the throttle in per cent."""
    return table.assign(throttle=1e2 * table["throttle"])


def steering_degrees(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give the steering in degrees."""
    return table.assign(steering=25.0 * table["steering"])


def swapped_commands(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Exchange throttle and steering."""
    return table.assign(throttle=table["steering"], steering=table["throttle"])


def turned_round(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Turn the body's axes round from the middle on, as when a tracker defines it anew."""
    later = np.arange(len(table)) >= len(table) // 2
    return table.assign(heading_rad=table["heading_rad"] + np.pi * later)


def no_heading(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Give a heading of zero throughout."""
    return table.assign(heading_rad=0.0)


def missing_column(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Leave the headings out."""
    return table.drop(columns="heading_rad")


def coarse_times(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Round times to a tenth of a second, so that several rows have the same."""
    return table.assign(t_s=table["t_s"].round(1))


def late_poses(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Begin to track three seconds after the first command."""
    return table.assign(x_m=table["x_m"].where(table["t_s"] > table["t_s"].iloc[0] + 3.0))


def _every_fifth(table: pd.DataFrame, rng: np.random.Generator, columns: Sequence[str]) -> pd.DataFrame:
    lost = rng.random(len(table)) < 0.2
    return pd.DataFrame({name: lost & (name in columns) for name in table.columns}, index=table.index)


DAMAGES: tuple[Damage, ...] = (
    missing_rows, gap, empty_poses, jump, clock_step, clock_back, latched, mirrored, clockwise, degrees, millimetres,
    milliseconds, swapped_axes, reversed_steering, reversed_throttle, empty_commands, words, infinite, repeated_rows,
    shuffled, swapped_bodies, centimetres, millimetres_later, percent, steering_degrees, swapped_commands,
    turned_round, no_heading, missing_column, coarse_times, late_poses,
)  # fmt: skip
"""New ones come last: the random numbers of each depend on its place."""


def tables(source: Source, seed: int) -> dict[str, pd.DataFrame]:
    """Return the replayed recordings as their CSV would have them."""
    replayed = source.replayed(Planted(("steering_lag", {"time_constant_s": LAG_S})), seed)
    rows: dict[str, list[pd.DataFrame]] = {}
    for run in replayed:
        frames, commands = run.frames, run.commands
        held = np.maximum(np.searchsorted(commands.t_s, frames.t_s + 1e-9, side="right") - 1, 0)
        columns = {"t_s": run.started_s + frames.t_s, "x_m": frames.x_m, "y_m": frames.y_m}
        columns |= {"heading_rad": frames.heading_rad, "throttle": commands.drive[held]}
        part = pd.DataFrame(columns | {"steering": commands.front[held]})
        rows.setdefault(str(run.extra["source"]), []).append(part)
    return {name: pd.concat(parts, ignore_index=True) for name, parts in rows.items()}


def outcome(vehicle: str, written: dict[str, pd.DataFrame], directory: Path) -> tuple[str, str]:
    """Return the kind of outcome of import and diagnosis, and a line about it."""
    files = []
    for name, table in written.items():
        files.append(directory / name)
        table.to_csv(files[-1], index=False)
    try:
        found = diagnose(import_recordings(vehicle, files, directory / "campaign"))
    except AgvbenchError as error:
        return "refused", str(error)
    except Exception:  # noqa: BLE001 - a crash is what is counted
        return "crash", traceback.format_exc().splitlines()[-1]
    named = {effect.name: effect for effect in found.effects}
    if (lag := named.get("steering_lag")) is None:
        return ("said" if str(found.verdict) in ("UNKNOWN", "NOT_IDENTIFIABLE") else "wrong"), repr(found)
    value = lag.parameters["time_constant_s"].value
    is_right = abs(value - LAG_S) < TOLERANCE * LAG_S
    return ("right" if is_right else "wrong"), f"{found.verdict}: {', '.join(named)}, {value:.3f} s"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the outcomes; return 1 if there was a crash."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicle", default="cpm", choices=("cpm", "eth"), help="one whose mapping has these columns")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first-seed", type=int, default=0)
    wanted = parser.parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 160)
    source, counts = Source.of(wanted.vehicle), Counter[str]()
    for seed in range(wanted.first_seed, wanted.first_seed + wanted.seeds):
        sound = tables(source, seed)
        for number, damage in enumerate(DAMAGES):
            rng = np.random.default_rng([0xDA3A6E, seed, number])
            written = {name: damage(table.copy(), rng) for name, table in sound.items()}
            with tempfile.TemporaryDirectory() as directory:
                kind, line = outcome(wanted.vehicle, written, Path(directory))
            counts[kind] += 1
            console.print(f"{damage.__name__}, seed {seed}: {kind}: {line}", highlight=False, markup=False)
    console.print(", ".join(f"{kind}: {count}" for kind, count in counts.items()))
    return int(counts["crash"] > 0)


if __name__ == "__main__":
    sys.exit(main())
