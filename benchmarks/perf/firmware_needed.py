"""What the benchmarks of the firmware do where it is not built, or where a drive fails: one line, and 2."""

from __future__ import annotations

import sys
from collections.abc import Callable

from agvbench.adapters.simavr.firmware_files import why_not_built
from agvbench.errors import AgvbenchError


def exit_code(measure: Callable[[], None]) -> int:
    """Return 0 after `measure`; 2, and why on the error stream, where it cannot be done."""
    try:
        if why := why_not_built():
            raise AgvbenchError(why)
        measure()
    except AgvbenchError as error:
        print(error, file=sys.stderr)
        return 2
    return 0
