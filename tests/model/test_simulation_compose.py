"""An effect from any module joins the simulation, and its machine code is kept."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest

from agvbench.effects import effect_kinds
from agvbench.errors import FileError
from agvbench.model.simulation import compose as simulation_compose
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

# Slower in a disc about (1, 0): depends on the place, so it needs short steps.
PATCH = """
from __future__ import annotations
from dataclasses import dataclass
from agvbench.effects import Effect, Stage, parameter
from agvbench.effects.state import FRONT_SPEED, REAR_SPEED, X, Y

@dataclass(frozen=True)
class SlowPatch(Effect):
    name = "slow_patch"
    stage = Stage.WHEELS
    longest_step_s = 0.025
    loss: float = parameter(unit="–", low=0.0, high=1.0, scale=0.1)

    @staticmethod
    def drive(state, loss):
        if (state[X] - 1.0) ** 2 + state[Y] ** 2 < 0.25:
            state[FRONT_SPEED] *= 1.0 - loss
            state[REAR_SPEED] *= 1.0 - loss
"""
PROGRAM = """
import numpy as np
from slow_patch import SlowPatch
from agvbench.model.simulation.simulation import SimulatedRun
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry
run = SimulatedRun(Commands(*np.array([[0.0], [1600.0], [1500.0], [1500.0]])), np.array([0.0, 10.0]))
simulation = Simulation(Geometry(0.2, 0.1), Command(1500.0, 1500.0, 1500.0), [run], kinds=[SlowPatch])
settled = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3]])
for loss in (0.0, 0.5):
    print(simulation.predict(settled, simulation.parameters([SlowPatch(loss)]), np.zeros((1, 4)))[-1, 0])
"""


@pytest.mark.slow
def test_an_effect_from_another_module(tmp_path, monkeypatch):
    (tmp_path / "slow_patch.py").write_text(PATCH, encoding="utf-8")
    monkeypatch.setenv("AGVBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    ends = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stdout.split()
    # One metre at half speed costs as long again as a metre takes: 1 m less in the same time, to a step's length.
    assert float(ends[0]) == pytest.approx(3.0, abs=1e-9)
    assert float(ends[1]) == pytest.approx(2.0, abs=0.01)
    assert list((tmp_path / "cache").rglob("*.nbc"))


def test_the_kernel_calls_every_hook_once_in_the_order_of_the_chain():
    kinds = tuple(effect_kinds().values())
    text = simulation_compose.kernel_text(kinds)
    first_number = sum(len(kind.parameters()) for kind in kinds)
    for index, kind in enumerate(kinds):
        for hook in kind.hooks():
            assert text.count(f"    _{hook}_{kind.name}(s") + text.count(f"time_s = _{hook}_{kind.name}(s") == 1
            # The number after the parameters is 0 where the effect is at null.
            guarded = rf"    if p\[{first_number + index}\] != 0.0:\n        (time_s = )?_{hook}_{kind.name}\(s"
            assert re.search(guarded, text)
    compile(text, "kernel", "exec")


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("AGVBENCH_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(FileError, match="set AGVBENCH_CACHE to a directory that can be written") as caught:
        simulation_compose.kernel.__wrapped__(tuple(effect_kinds().values()))
    assert "\n" not in str(caught.value)


def test_an_edited_kernel_is_written_again(tmp_path, monkeypatch):
    monkeypatch.setenv("AGVBENCH_CACHE", str(tmp_path))
    simulation_compose.kernel.__wrapped__(())
    (path,) = tmp_path.glob("kernel_*.py")
    text = path.read_text(encoding="utf-8")
    path.write_text("1 / 0", encoding="utf-8")
    simulation_compose.kernel.__wrapped__(())
    assert path.read_text(encoding="utf-8") == text


def test_runs_are_packed_one_after_another():
    run = SimulatedRun(Commands(*np.array([[0.0], [1600.0], [1500.0], [1500.0]])), np.array([0.0, 10.0]))
    simulation = Simulation(Geometry(0.2, 0.1), NEUTRAL, [run, run])
    assert len(simulation) == 2
    assert simulation.row_starts.tolist() == [0, 2, 4]
    assert simulation.drive.tolist() == [1500.0, 1600.0, 1500.0, 1600.0]
