"""What tests of rigs share: how to drive two runs, and how to compare what came back."""

from __future__ import annotations

import hashlib
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

from agvbench.bus.link import VehicleLink
from agvbench.types import Command, Frames, Pose

_PLANTS = Path(__file__).with_name("tiny_plant.py")
TINY, UNWORN, HANGING, FAILING = (
    f"{_PLANTS}:{name}" for name in ("TinyPlant", "UnwornPlant", "HangingPlant", "FailingPlant")
)
NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(0.5, -0.25, 0.75)


def drive_run(link: VehicleLink, run_key: str, holds_s: tuple[float, ...] = (0.7, 0.05, 1.3)) -> Frames:
    """Watch the vehicle at rest, drive, and wait for late frames."""
    link.reset(START, run_key=run_key)
    parts = [link.control_cycle(NEUTRAL, t_s=-0.5, hold_s=0.5)]
    t_s = 0.0
    for index, hold_s in enumerate(holds_s):
        parts.append(link.control_cycle(Command(1800.0, 1400.0 + 50.0 * index, 1550.0), t_s=t_s, hold_s=hold_s))
        t_s += hold_s
    parts += [link.control_cycle(NEUTRAL, t_s=t_s, hold_s=0.5), link.flush()]
    link.stop()
    return Frames.concatenate(parts)


def digest(frames: Frames) -> str:
    """Return a hash of every bit of the frames."""
    columns = (getattr(frames, field.name) for field in fields(frames))
    return hashlib.sha256(b"".join(column.tobytes() for column in columns)).hexdigest()


@contextmanager
def process(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``agvbench`` with `arguments` until it says that it is ready; end it with SIGTERM afterwards."""
    command = [sys.executable, "-c", "from agvbench.cli import main; raise SystemExit(main())", *arguments]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        ready = child.stdout.readline()
        assert ready.startswith("ready: "), child.communicate()[1]
        yield child
        if child.poll() is None:
            child.send_signal(signal.SIGTERM)
            output, errors = child.communicate(timeout=20)
            assert (child.returncode, output, errors) == (0, "stopped\n", "")
    finally:
        if child.poll() is None:
            child.kill()
        child.communicate()
