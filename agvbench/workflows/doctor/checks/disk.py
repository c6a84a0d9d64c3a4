"""Whether there is room for what will be recorded."""

from __future__ import annotations

import os
import shutil

from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_LEAST_BYTES = 1 << 30


class DiskCheck(Check):
    """Looks at the folder that campaigns are written to."""

    name = "disk"

    def examine(self, lab: Lab) -> Finding:
        """Compare what is free with a gigabyte: a day of runs takes some hundred megabytes."""
        if not lab.folder.is_dir() or not os.access(lab.folder, os.W_OK):
            return Finding(
                FindingState.BAD, f"{lab.folder.absolute()} cannot be written to", "change to a folder of your own"
            )
        free = shutil.disk_usage(lab.folder).free
        said = f"{free / (1 << 30):.1f} GiB free in {lab.folder.absolute()}"
        if free < _LEAST_BYTES:
            return Finding(FindingState.BAD, f"{said} (limit: 1 GiB)", "make room")
        return Finding(FindingState.GOOD, said)
