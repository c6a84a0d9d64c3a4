"""`CheckedPlant`: a plug-in plant with every answer checked, and input validation for the plants that ship."""

from __future__ import annotations

import math
import threading
import traceback
from collections.abc import Callable, Iterable, Mapping, Sized
from pathlib import Path
from typing import Any, TypeVar, cast

from agvbench.errors import PlantError
from agvbench.types import Plant

Answer = TypeVar("Answer")


class CheckedPlant:
    """A plant whose exceptions and bad answers become `PlantError`, reported in one line with the plant's name.

    Parameters
    ----------
    plant
        What a factory returned.
    name
        What the user called it: ``"my_plant.py:make_plant"``.

    Raises
    ------
    PlantError
        If `plant` lacks ``reset`` or ``advance``; later, if a call raises or answers with anything but three finite
        numbers.
    """

    def __init__(self, plant: object, name: str) -> None:
        missing = [method for method in ("reset", "advance") if not callable(getattr(plant, method, None))]
        if missing or isinstance(plant, type):
            lacks = f", which lacks {' and '.join(missing)}" if missing else ", not an instance of it"
            raise PlantError(
                f"factory returned {_kind(plant)}{lacks}", where=name,
                remedy="return an object with reset(pose, *, seed) and advance(drive, front, rear, dt)",
            )  # fmt: skip
        self._plant: Plant = plant  # type: ignore[assignment]
        self.name = name

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put the vehicle at rest at `pose` (m, m, rad)."""
        self._guard("reset", lambda: self._plant.reset(pose, seed=seed))

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Hold the command for `dt` seconds; return the pose (m, m, rad), three finite floats."""
        try:
            answer = self._plant.advance(drive, front, rear, dt)
        except BaseException as error:
            raise raised(error, f"{self.name}: advance") from error
        return self._pose(answer)

    def true_state(self) -> Mapping[str, float]:
        """Return what the plant says of itself, for figures; nothing if it says nothing."""
        true_state = getattr(self._plant, "true_state", None)
        if not callable(true_state):
            return {}
        state = self._guard("true_state", true_state)
        if not isinstance(state, Mapping):
            raise PlantError(
                f"true_state returned {_kind(state)}", where=self.name, remedy="return a mapping of names to numbers"
            )
        return state

    def _guard(self, method: str, call: Callable[[], Answer]) -> Answer:
        try:
            return call()
        except BaseException as error:
            raise raised(error, f"{self.name}: {method}") from error

    def _pose(self, answer: object) -> tuple[float, float, float]:
        pose = _three_numbers(answer)
        if pose is None:
            raise PlantError(
                f"advance returned {_kind(answer)}", where=self.name, value=_short(answer),
                remedy="return three numbers: x [m], y [m], heading [rad]",
            )  # fmt: skip
        if not math.isfinite(pose[0] + pose[1] + pose[2]):
            raise PlantError(
                "advance returned a pose that is not finite", where=self.name, value=pose,
                remedy="keep the plant's equations finite for every command in range",
            )  # fmt: skip
        return pose


def _three_numbers(answer: object) -> tuple[float, float, float] | None:
    """Return the answer as three floats, or None."""
    if isinstance(answer, str | bytes):
        return None
    try:
        x, y, heading = cast("Iterable[Any]", answer)
        if any(isinstance(number, str | bytes) for number in (x, y, heading)):
            return None
        return float(x), float(y), float(heading)
    except (TypeError, ValueError):
        return None


def raised(error: BaseException, where: str) -> BaseException:
    """Return what to raise for whatever a plant raised: a `PlantError`, or Ctrl-C, which only the main thread gets.

    A plant that ends the thread in which it is driven (`sys.exit`) would leave its runner without an answer.
    """
    in_main = threading.current_thread() is threading.main_thread()
    return error if isinstance(error, KeyboardInterrupt) and in_main else as_plant_error(error, where)


def as_plant_error(error: BaseException, where: str) -> PlantError:
    """Return an exception from a plant as a `PlantError` that says what, and on which line."""
    if isinstance(error, PlantError):
        inner = where if error.where is None or where.endswith(f": {error.where}") else f"{where}: {error.where}"
        return PlantError(error.what, where=inner, value=error.value, limit=error.limit, remedy=error.remedy)
    what = f"raised {type(error).__name__}"
    text = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    return PlantError(f"{what}: {text}" if text else what, where=where, remedy=_line_to_look_at(error))


def _line_to_look_at(error: BaseException) -> str | None:
    """Return ``"look at FILE, line N"`` for the innermost frame outside this package, or None."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"look at {Path(error.filename).name}, line {error.lineno}"
    here = str(Path(__file__).parent)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((here, "<"))]
    return f"look at {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else None


def _kind(value: object) -> str:
    if value is None:
        return "None"
    kind = type(value).__name__
    if isinstance(value, type):
        return f"the class {value.__name__}"
    article = "an" if kind[0] in "aeiouAEIOU" else "a"
    length = f" of length {len(value)}" if isinstance(value, Sized) else ""
    return f"{article} {kind}{length}"


def _short(value: object, limit: int = 60) -> str | None:
    if value is None:
        return None
    text = " ".join(repr(value).split())
    return text if len(text) <= limit else text[: limit - 1] + "…"


LONGEST_ADVANCE_S = 86_400.0


def checked_pose(pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a pose to be reset to (m, m, rad) as plain floats.

    Raises
    ------
    PlantError
        If it is not finite.
    """
    x, y, heading = (float(value) for value in pose)
    if not math.isfinite(x + y + heading):
        raise PlantError(
            "start pose is not finite", where="reset", value=tuple(pose), remedy="give x, y in m and heading in rad"
        )
    return x, y, heading


def checked_delay(frames: float, most: int) -> None:
    """Raise `PlantError` unless a command's delay is from none to `most` frames."""
    if not 0 <= frames <= most:
        raise PlantError(
            "command delay is out of range", where="delay_frames", value=frames, limit=f"0 to {most} frames"
        )


def checked_advance(drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float, float]:
    """Return a command and how long to hold it [s] as plain floats.

    Raises
    ------
    PlantError
        If a command is not a finite number, or `dt` is negative, not finite or over a day.
    """
    try:
        drive, front, rear, dt = float(drive), float(front), float(rear), float(dt)
    except (TypeError, ValueError):
        raise PlantError("command is not a number", where="advance", value=(drive, front, rear, dt)) from None
    if not math.isfinite(drive + front + rear):
        raise PlantError("command is not finite", where="advance", value=f"drive {drive}, front {front}, rear {rear}")
    if not 0.0 <= dt <= LONGEST_ADVANCE_S:
        raise PlantError(
            "time step is out of range", where="advance", value=f"{dt} s", limit=f"0 to {LONGEST_ADVANCE_S:.0f} s"
        )
    return drive, front, rear, dt
