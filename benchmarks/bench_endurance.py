"""Endurance (agvbench): circles at full speed until the battery shows (thesis section 8.1, table 8.2).

Thirty drives of five minutes; with ``--full`` for 8 hours and 18 minutes as in the thesis.
"""

import pytest

DRIVE_S = 300.0


@pytest.mark.repeats(30, full=100)
def bench_endurance(drive):
    """Drive circles with the front axle a third to the left."""
    drive.hold(drive=1.0, front=0.5, rear=-0.5, for_s=DRIVE_S)
