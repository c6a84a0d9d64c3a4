"""Whether the host's clock is good enough to stamp poses with."""

from __future__ import annotations

import time

from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_RESOLUTION_S = 1e-5
_PAUSE_S, _LATE_S, _TIMES = 0.001, 0.02, 50


class HostClockCheck(Check):
    """Looks at the monotonic clock, and at how late this machine wakes a process."""

    name = "clock"

    def examine(self, lab: Lab) -> Finding:
        """Sleep fifty times for a millisecond."""
        resolution_s = time.get_clock_info("monotonic").resolution
        if resolution_s > _RESOLUTION_S:
            return Finding(
                FindingState.BAD, f"monotonic clock ticks every {resolution_s:g} s (limit: {_RESOLUTION_S:g} s)"
            )
        worst_s = 0.0
        for _ in range(_TIMES):
            began_s = time.monotonic()
            time.sleep(_PAUSE_S)
            worst_s = max(worst_s, time.monotonic() - began_s - _PAUSE_S)
        said = f"a sleeping process is woken up to {worst_s * 1e3:.1f} ms late"
        if worst_s > _LATE_S:
            return Finding(
                FindingState.DOUBTFUL, f"{said} (limit: {_LATE_S * 1e3:g} ms)", "end what else keeps it busy"
            )
        return Finding(FindingState.GOOD, said)
