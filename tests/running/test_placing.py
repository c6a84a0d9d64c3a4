"""A real vehicle is waited for: here one that moves in real time, and is put down by software."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from agvbench.adapters import open_rig
from agvbench.errors import LinkError
from agvbench.running.positioning.start_pose import wait_for_start, wait_until_seen
from agvbench.types import Command, Pose

pytestmark = pytest.mark.real_time

NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(0.5, -0.5, 1.0)


def test_a_run_begins_when_the_vehicle_stands_at_its_start() -> None:
    told: list[str] = []
    with open_rig("live", seed=1) as link:
        link.reset(Pose(0.2, -0.1, 1.1), run_key="a")

        def put_down_when_told(text: str) -> None:
            told.append(text)
            link.reset(START, run_key="b")

        wait_for_start(link, NEUTRAL, START, patience_s=20.0, on_progress=put_down_when_told)
    assert len(told) == 1
    assert told[0].startswith("put agv1 at x = 0.500 m, y = -0.500 m, heading 57.3°: it is 500 mm and 5.7° off")


def test_patience_ends() -> None:
    with open_rig("live", seed=1) as link:
        link.reset(Pose(0.5, -0.45, 1.0), run_key="a")
        with pytest.raises(LinkError, match=r"was not put at the start: it is 50 mm and 0.\d° off \(limit: 1 s\)"):
            wait_for_start(link, NEUTRAL, START, patience_s=1.0, on_progress=lambda _: None)


@pytest.mark.parametrize(("fault", "said"), [
    ("silent", r"waiting for agv1: no frame arrived from sim; start its stream, or see address, port and firewall"),
    ("untracked", r"waiting for agv1: it is not seen: \d+ frames/s arrive from sim, but without the vehicle"),
])  # fmt: skip
def test_a_missing_stream_is_distinguished_from_a_vehicle_out_of_view(fault: str, said: str) -> None:
    told: list[str] = []
    with open_rig("live", f"impaired:{fault}:sim", seed=1) as link:
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        wait_until_seen(link, NEUTRAL, patience_s=1.0, on_progress=told.append)
    assert told
    assert all(re.fullmatch(said, line) for line in told), told


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "write-an-adapter.md"
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
BENCHMARK = """
'For agvbench.'
def bench_straight(drive):
    drive.hold(drive=0.5, for_s=0.3)
"""


def read_until(terminal: int, wanted: str) -> str:
    """Return what appears at a terminal, at least until `wanted` does."""
    said = b""
    while wanted.encode() not in said and len(said) < 20_000 and select.select([terminal], [], [], 60.0)[0]:
        said += os.read(terminal, 4096)
    return said.decode()


def test_an_operator_at_a_terminal_is_told_where_to_put_the_vehicle_and_of_a_pause(tmp_path: Path) -> None:
    source = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert source is not None
    (tmp_path / "my_lab.py").write_text(source[1], encoding="utf-8")
    (tmp_path / "bench_one.py").write_text(BENCHMARK)
    # A real vehicle, and a camera that sees nothing.
    options = ["--agv=my_lab.py:127.0.0.1:9", "--mocap=my_lab.py:0", "--out=c", "--no-report"]
    here, there = pty.openpty()
    command = [sys.executable, "-c", PROGRAM, "bench", "bench_one.py", *options]
    session = subprocess.Popen(command, cwd=tmp_path, stdin=there, stdout=there, stderr=there)
    os.close(there)
    try:
        said = read_until(here, "no frame arrived")
        assert "put agv1 at x = -0.054 m, y = -0.000 m, heading 0.0°: no frame arrived from my_lab; start its " in said
        session.send_signal(signal.SIGTSTP)
        said = read_until(here, "Ctrl-Z again")
        assert "pausing when this run is finished; Ctrl-Z again" in said
        session.send_signal(signal.SIGTERM)
        assert "ended by SIGTERM" in read_until(here, "--resume --out c")
    finally:
        session.kill()
        session.wait()
        os.close(here)
