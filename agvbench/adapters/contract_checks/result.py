"""A check's result, and how a check is run: an exception or a call that hangs is a result, too."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

from agvbench.errors import AgvbenchError

CALL_LIMIT_S = 10.0
"""How long [s] a method of an adapter may take."""
_PACKAGE = str(Path(__file__).parents[2])

_Value = TypeVar("_Value")


class CheckResult(NamedTuple):
    """One line: which check, whether it passed, what was found, and what to do about it."""

    name: str
    passed: bool
    found: str
    remedy: str = ""


class CheckFailedError(Exception):
    """Ends a check with what was found and the remedy."""

    def __init__(self, found: str, remedy: str = "") -> None:
        super().__init__(found)
        self.found, self.remedy = found, remedy


def run_check(name: str, check: Callable[[], str]) -> CheckResult:
    """Return the result of `check`, which returns what was found or raises."""
    try:
        return CheckResult(name, True, check())
    except CheckFailedError as failure:
        return CheckResult(name, False, failure.found, failure.remedy)
    except AgvbenchError as error:
        return CheckResult(name, False, str(error))
    except (Exception, SystemExit) as error:  # noqa: BLE001  (whatever an adapter raises is what was found)
        return CheckResult(name, False, *_raised(error))


def _raised(error: BaseException) -> tuple[str, str]:
    """Return what was raised, and the innermost line outside agvbench, or inside it if there is no other."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith("<")]
    own = [frame for frame in frames if not frame.filename.startswith(_PACKAGE)] or frames
    text = " ".join(f"raised {type(error).__name__}: {error}".split())
    return text, f"look at {Path(own[-1].filename).name}, line {own[-1].lineno}"


def call(name: str, method: Callable[[], _Value], limit_s: float = CALL_LIMIT_S) -> _Value:
    """Return what `method` returns, or raise what it raises.

    Raises
    ------
    CheckFailedError
        If it does not return within `limit_s` [s].
    """
    returned: list[_Value] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            returned.append(method())
        except BaseException as error:  # noqa: BLE001  (raised again in the thread that waits)
            raised.append(error)

    thread = threading.Thread(target=run, name=f"contract-check-{name}", daemon=True)
    thread.start()
    thread.join(limit_s)
    if raised:
        raise raised[0]
    if not returned:
        raise CheckFailedError(
            f"{name} does not return (limit: {limit_s:g} s)", "wait in a thread of your own, with a time limit"
        )
    return returned[0]
