"""What a metric is: a number with a unit that one run gives, and the decorator that makes one of a function."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from agvbench.errors import FileError, FitError
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.own_modules import shown_file

Evaluate = Callable[[MeasuredRun], float]
_NAME = re.compile(r"[a-z][a-z0-9_]{0,59}")
_LONGEST_UNIT = 12


@dataclass(frozen=True)
class Metric:
    """A number that a run gives; smaller magnitudes are better.

    Parameters
    ----------
    name
        What tables, ``compare`` and gates call it: lower case, digits and underscores.
    unit
        Of its numbers, as people read it (``"mm"``, ``"deg"``, ``"J"``); "" for none.
    title
        What tables print: ``"cross-track error, RMS"``.
    definition
        One sentence or two, with source where there is one.
    digits
        Decimals worth printing.
    margin
        The largest difference that needs no action, in `unit`.
    evaluate
        The function: the number of a run, or NaN where the run has none (no plan, nothing logged).
    """

    name: str
    unit: str
    title: str
    definition: str
    digits: int
    margin: float
    evaluate: Evaluate

    def of(self, run: MeasuredRun) -> float:
        """Return the number of a run; NaN where it has none.

        Raises
        ------
        FileError
            If the function fails, or returns what is no number; the error names file and line.
        """
        try:
            value = self.evaluate(run)
            return float(value)
        except FitError:  # the start or end pose cannot be measured
            return math.nan
        except Exception as error:
            raise self._failed(error, run) from error

    def _failed(self, error: Exception, run: MeasuredRun) -> FileError:
        file, traceback = inspect.getfile(self.evaluate), error.__traceback__
        line = self.evaluate.__code__.co_firstlineno
        while traceback is not None:
            if traceback.tb_frame.f_code.co_filename == file:
                line = traceback.tb_lineno
            traceback = traceback.tb_next
        where = f"{shown_file(file)}:{line}: metric {self.name}, run {run.run_id}"
        remedy = "correct it, or return math.nan for a run without the number"
        return FileError("cannot be evaluated", where=where, value=f"{type(error).__name__} {error}", remedy=remedy)


def metric(
    *, unit: str, title: str = "", digits: int = 1, margin: float = 0.0, definition: str = ""
) -> Callable[[Evaluate], Metric]:
    """Return a decorator that makes a `Metric` of a function of a run; its name is that of the function.

    Parameters
    ----------
    unit, digits, margin
        As in `Metric`.
    title
        As in `Metric`; by default the name with spaces.
    definition
        As in `Metric`; by default the first paragraph of the function's docstring.

    Raises
    ------
    FileError
        If the name, the unit, the digits or the margin cannot be used; the error names file and line.

    Examples
    --------
    >>> @metric(unit="m")
    ... def start_x(run):
    ...     "Where the run began on the floor."
    ...     return run.frames.x_m[0]
    >>> start_x.title, start_x.definition
    ('start x', 'Where the run began on the floor.')
    """

    def decorate(function: Evaluate) -> Metric:
        name = function.__name__
        where = f"{shown_file(inspect.getfile(function))}:{function.__code__.co_firstlineno}: metric {name}"
        if not _NAME.fullmatch(name):
            raise FileError("has a name that cannot be used", where=where, limit="lower case, digits and underscores")
        if len(unit) > _LONGEST_UNIT or not unit.isprintable():
            raise FileError("has a unit that cannot be used", where=where, value=unit, limit=f"{_LONGEST_UNIT} letters")
        if not (math.isfinite(margin) and margin >= 0.0 and 0 <= digits <= 9):
            value, limit = f"margin {margin:g}, digits {digits}", "a finite margin ≥ 0, digits 0 to 9"
            raise FileError("has a number that cannot be used", where=where, value=value, limit=limit)
        said = definition or inspect.cleandoc(function.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
        return Metric(name, unit, title or name.replace("_", " "), said, digits, margin, function)

    return decorate
