"""Samples from free driving: no run holds a command, so curves are read from windows in which it hardly changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.calibration.drive_regression import DriveData, DriveRegression, regress_drive
from agvbench.calibration.measurement.windows import WINDOW_S, Windows, command_spread, held_command, measured_windows
from agvbench.calibration.samples import Sample
from agvbench.errors import FitError
from agvbench.types import Floats, Run
from agvbench.vehicle.channels import Role
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import wheel_speed

_MOVES_MPS = 0.05
_DELAYS_S = np.arange(0.0, 0.61, 0.02)
_STEADY_BEFORE_S = 0.3
_STEADY_SHARE = 0.05
_LEVELS = 40
_MIN_WINDOWS = 50
_MIN_PER_LEVEL = 5


@dataclass(frozen=True)
class _Drive:
    run: Run
    windows: Windows


@dataclass(frozen=True)
class FreeDriving:
    """Samples of all roles, the drive's map (which no single level of it shows), what was noticed, runs used."""

    samples: list[Sample]
    drive: DriveRegression
    words: list[str]
    runs_used: int


def read_free_driving(runs: Sequence[Run], geometry: Geometry, header: HeaderLike) -> FreeDriving:
    """Return what windows of free driving say about all roles.

    *Steering.* Each window's motion implies both axle angles (`axle_angles`). The angle follows the command late; the
    delay, 0 to 0.6 s, is the one under which the angle is most nearly a function of the command. Windows in which the
    command of `delay` ago had changed by more than 5 % of its range within 0.3 s are not steady and left out.

    *Drive.* Speed settles slowly, falls in turns, and differs between sessions (battery, floor). A driver that holds
    the speed gives more command where the vehicle is slower. One regression separates these (`regress_drive`).

    Commands are gathered into at most 40 levels over their range; each window is a sample at its level's median.

    Raises
    ------
    FitError
        If no run has moving windows enough.
    """
    drives = [_Drive(run, measured_windows(run, geometry)) for run in runs if run.is_ok and len(run.commands)]
    moving = [_Drive(d.run, d.windows.select(np.abs(d.windows.forward_mps) > _MOVES_MPS)) for d in drives]
    moving = [d for d in moving if len(d.windows)]
    total = sum(len(d.windows) for d in moving)
    if total < _MIN_WINDOWS:
        raise FitError(
            "has neither calibration runs nor free driving to calibrate from",
            where=f"campaign {header.name}",
            value=f"{total} windows of {WINDOW_S} s in motion, {len(runs)} runs",
            limit=f"at least {_MIN_WINDOWS}",
            remedy="drive bench_calibration.py first",
        )
    words: list[str] = []
    samples = _steering(moving, "front", words) + _steering(moving, "rear", words)
    drive_samples, drive = _drive(moving, header, words)
    return FreeDriving(samples + drive_samples, drive, words, len(moving))


def _steering(drives: list[_Drive], role: Role, words: list[str]) -> list[Sample]:
    angle = np.concatenate([getattr(d.windows, f"{role}_rad") for d in drives])
    spread = float(np.ptp(np.concatenate([getattr(d.run.commands, role) for d in drives])))
    owner = np.repeat([d.run.run_id for d in drives], [len(d.windows) for d in drives])
    if spread == 0.0:
        command = np.concatenate([held_command(d.run.commands, role, d.windows.t_s) for d in drives])
        return _samples(role, command, angle, owner)
    delay = _delay(drives, role, angle, spread)
    command = _delayed(drives, role, delay)
    steady = _spread_before(drives, role, delay, _STEADY_BEFORE_S) <= _STEADY_SHARE * spread
    words.append(
        f"{role}: {np.count_nonzero(steady)} of {len(steady)} windows are steady; "
        f"the axle follows its command by {delay:.2f} s"
    )
    level, kept = _levels(command, steady, spread)
    return _samples(role, level[kept], angle[kept], owner[kept])


def _delayed(drives: list[_Drive], role: str, delay_s: float) -> Floats:
    return np.concatenate([held_command(d.run.commands, role, d.windows.t_s - delay_s) for d in drives])


def _delay(drives: list[_Drive], role: str, angle: Floats, spread: float) -> float:
    """Return the delay under which the angle is most nearly a function of the command, judged where it changes."""
    changing = _spread_before(drives, role, 0.0, float(_DELAYS_S[-1]) + WINDOW_S / 2.0) > _STEADY_SHARE * spread
    if np.count_nonzero(changing) < _MIN_WINDOWS:
        return 0.0
    dispersions = []
    for delay in _DELAYS_S:
        level, kept = _levels(_delayed(drives, role, delay), None, spread)
        if not changing[kept].any():
            dispersions.append(np.inf)  # no level has windows enough
            continue
        _, index = np.unique(level[kept], return_inverse=True)
        middle = np.array([np.median(angle[kept][index == k]) for k in range(index.max() + 1)])
        off = np.abs(angle[kept] - middle[index])[changing[kept]]
        dispersions.append(float(np.mean(np.minimum(off, 3.0 * np.median(off)))))
    return float(_DELAYS_S[int(np.argmin(dispersions))])


def _spread_before(drives: list[_Drive], role: str, delay_s: float, before_s: float) -> Floats:
    """Return how much the command varied from `before_s` before to half a window after the time `delay_s` ago."""
    return np.concatenate(
        [
            command_spread(
                d.run.commands,
                role,
                np.maximum(d.windows.t_s - delay_s - before_s, d.run.commands.t_s[0]),
                d.windows.t_s - delay_s + WINDOW_S / 2.0,
            )
            for d in drives
        ]
    )


def _levels(command: Floats, usable: NDArray[np.bool_] | None, spread: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Return for each command the median command of its level, and which are usable, in levels with enough of them."""
    known = np.isfinite(command) if usable is None else usable & np.isfinite(command)
    bins = np.full(len(command), -1, dtype=np.int64)
    lowest = np.min(command[known]) if known.any() else 0.0
    bins[known] = np.round((command[known] - lowest) / spread * _LEVELS).astype(np.int64)
    level, kept = command.copy(), np.zeros(len(command), dtype=np.bool_)
    for k in np.unique(bins[known]):
        inside = bins == k
        if np.count_nonzero(inside) >= _MIN_PER_LEVEL:
            level[inside], kept[inside] = np.median(command[inside]), True
    return level, kept


def _drive(moving: list[_Drive], header: HeaderLike, words: list[str]) -> tuple[list[Sample], DriveRegression]:
    def gathered(name: str) -> Floats:
        return np.concatenate([getattr(d.windows, name) for d in moving])

    counts = [len(d.windows) for d in moving]
    command = np.concatenate([held_command(d.run.commands, "drive", d.windows.t_s) for d in moving])
    spread = float(np.ptp(command[np.isfinite(command)]))
    level, kept = _levels(command, None, spread or 1.0)
    front, rear = gathered("front_rad"), gathered("rear_rad")
    along = wheel_speed(1.0, front, rear, header.geometry)  # along the wheels, as in eq. 5.6
    data = DriveData(
        command=command[kept],
        speed_mps=(along * gathered("forward_mps"))[kept],
        acceleration_mps2=(along * gathered("acceleration_mps2"))[kept],
        turned=(np.abs(np.tan(front)) + np.abs(np.tan(rear)))[kept],
        session=np.repeat([d.run.session or "" for d in moving], counts)[kept],
    )
    regression = regress_drive(data, header.neutral.drive)
    words += [f"drive: {word}" for word in regression.words]
    owner = np.repeat([d.run.run_id for d in moving], counts)
    return _samples("drive", level[kept], regression.settled_mps, owner[kept]), regression


def _samples(role: Role, command: Floats, value: Floats, owner: NDArray[np.str_]) -> list[Sample]:
    usable = np.isfinite(command) & np.isfinite(value)
    return [
        Sample(role, float(c), float(v), np.nan, str(run_id))
        for c, v, run_id in zip(command[usable], value[usable], owner[usable], strict=True)
    ]
