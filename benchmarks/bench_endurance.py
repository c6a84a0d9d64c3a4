"""Endurance (agvbench): circles at full speed until the battery shows (thesis section 8.1, table 8.2).

Thirty drives of five minutes; with ``--full`` a hundred, which is as long as the thesis drove.
"""

import pytest

DRIVE_S = 300.0


@pytest.mark.repeats(30, full=100)
def bench_endurance(drive):
    """Drive circles, the front axle turned half to the left and the rear half to the right."""
    drive.hold(drive=1.0, front=0.5, rear=-0.5, for_s=DRIVE_S)
