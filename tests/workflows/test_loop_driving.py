"""What happens to a loop whose bench is stopped, and to a bench whose loop is."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from agvbench.campaign import Campaign
from agvbench.loop.sessions import _run
from agvbench.loop.settings import BEFORE, DIAGNOSIS

pytestmark = pytest.mark.real_time

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"


def start(folder, *options):
    command = [sys.executable, "-c", PROGRAM, "loop", "--out=x", "--repeats=1", *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)


def test_a_loop_does_not_go_on_after_a_fault_stopped_its_bench(tmp_path):
    process = start(tmp_path, "--agv=impaired:fails@3/1:sim")
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 2
    event, stopped = errors.splitlines()
    assert event == "agv reports LinkError: the agv adapter failed: RuntimeError: impaired on purpose"
    assert stopped.startswith("agvbench loop: the bench was stopped in run ")
    assert "--resume" in errors
    assert not (tmp_path / "x" / DIAGNOSIS).exists()
    runs = list(Campaign.open(tmp_path / "x" / BEFORE))
    assert [run.is_ok for run in runs] == [True, True, False]


@pytest.mark.slow
def test_whoever_ends_the_loop_ends_its_bench_which_stops_the_vehicle_first(tmp_path):
    process = start(tmp_path)
    parts = tmp_path / "x" / BEFORE / "runs.parquet"
    for _ in range(3000):
        if len(list(parts.glob("[!.]*.parquet"))) > 2 or process.poll() is not None:
            break
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 143
    assert errors == "agvbench loop: interrupted: SIGTERM\n"
    last = list(Campaign.open(tmp_path / "x" / BEFORE))[-1]
    assert last.is_ok or last.status == "aborted: interrupted"
    recorded = len(list(parts.glob("[!.]*.parquet")))
    time.sleep(1.0)
    assert len(list(parts.glob("[!.]*.parquet"))) == recorded


ASKING = """
import pathlib, sys, time
print("put agv1 at x = 1 m", file=sys.stderr, flush=True)
until = time.monotonic() + 30.0
while not pathlib.Path(sys.argv[1]).exists() and time.monotonic() < until:
    time.sleep(0.01)
print("ERROR: that is why", file=sys.stderr)
sys.exit(0 if pathlib.Path(sys.argv[1]).exists() else 5)
"""


def test_what_an_operator_is_asked_is_passed_on_while_the_bench_waits(tmp_path, monkeypatch):
    put_down = tmp_path / "put down"

    class Operator:
        def write(self, text):
            assert text == "put agv1 at x = 1 m\n"
            put_down.touch()

    monkeypatch.setattr(sys, "stderr", Operator())
    assert _run([sys.executable, "-c", ASKING, str(put_down)]) == (0, ["that is why"])
