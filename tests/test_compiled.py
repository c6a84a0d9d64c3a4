"""Compiled code is that of the sources as they are now, also of those that it only imports from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from agvbench.compiled import COMPILING

LAW = """
from agvbench.compiled import cached_njit
GAIN = {gain}

@cached_njit()
def law(x):
    return GAIN * x

class Shared:
    @staticmethod
    def steer(state, size):
        state[0] += {gain} * size
"""
KERNEL = """
from agvbench.compiled import cached_njit
from plant import law as laws

@cached_njit()
def run(x):
    return laws.law(x)
"""
EFFECT = """
from dataclasses import dataclass
from agvbench.effects import Effect, Stage, parameter
from plant.law import Shared

@dataclass(frozen=True)
class Own(Shared, Effect):
    name = "own"
    stage = Stage.WHEELS
    size: float = parameter(unit="–", low=0.0, high=1.0, scale=0.1)
"""
PROGRAM = """
from plant.effect import Own
from plant.kernel import run
from agvbench.model.simulation.compose import kernel
kernel((Own,))
print(run(1.0))
"""


def run(folder: Path, gain: float) -> float:
    (folder / "plant" / "law.py").write_text(LAW.format(gain=gain), encoding="utf-8")
    # Python takes a source that is edited within the same second, to the same size, for the one that it compiled.
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "AGVBENCH_CACHE": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-c", PROGRAM]
    return float(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)


def test_an_edited_source_is_compiled_again_in_whatever_imports_from_it(tmp_path):
    (tmp_path / "plant").mkdir()
    for name, text in (("__init__", ""), ("kernel", KERNEL), ("effect", EFFECT)):
        (tmp_path / "plant" / f"{name}.py").write_text(text, encoding="utf-8")
    for count, gain in enumerate((2.0, 3.0), start=1):
        assert run(tmp_path, gain) == gain
        kernels = list((tmp_path / "cache").glob("kernel_*.py"))
        assert len(kernels) == count, "the file from which a hook is inherited is a source, too"
    assert list((tmp_path / "cache").rglob("*run*.nbc"))


TELLING = """
from agvbench.compiled import announcing_compilation
with announcing_compilation(print):
    from agvbench.calibration.measurement.circle import fit_circle
    import numpy as np
    angle = np.linspace(0.0, 1.0, 50)
    fit_circle(np.stack([np.cos(angle), np.sin(angle)], axis=1))
"""


@pytest.mark.slow
def test_compiling_is_said_once_and_only_where_nothing_is_kept(tmp_path):
    environment = os.environ | {"AGVBENCH_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", TELLING]
    first, second = (
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout for _ in range(2)
    )
    assert first == f"{COMPILING}\n"
    assert second == ""
