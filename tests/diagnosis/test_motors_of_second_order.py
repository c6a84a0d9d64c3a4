"""Motors of second order, simulated by a program that shares no code with the model, and a control without a cause."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from agvbench.campaign import Campaign
from agvbench.diagnosis import Verdict, diagnose

SIMULATOR = Path(__file__).parents[2] / "benchmarks/independent/differential_wheels.py"


def campaign(folder: Path, causes: str) -> tuple[Campaign, dict[str, dict[str, float]]]:
    """Return a campaign of the independent simulator, and what it hid."""
    command = [sys.executable, str(SIMULATOR), "write", str(folder), "--vehicle", "1", "--causes", causes]
    subprocess.run(command, check=True, capture_output=True)
    truth = json.loads(folder.with_name(f"{folder.name}.truth.json").read_text(encoding="utf-8"))
    return Campaign.open(folder), truth["causes"]


@pytest.mark.slow
def test_motors_of_second_order_are_named_with_their_size(tmp_path: Path) -> None:
    recorded, causes = campaign(tmp_path / "c", "motor_inertia")
    found = diagnose(recorded)
    assert found.verdict is Verdict.NAMED
    [effect] = found.effects
    assert (effect.name, effect.evidence["form"]) == ("wheel_lag", "wheel_lag_inertia")
    assert not effect.confounded_with
    hidden = causes["motor_inertia"]
    for name, value in ((name, parameter.value) for name, parameter in effect.parameters.items()):
        assert value == pytest.approx(hidden[name], rel=0.04)  # the simulator's motors also have a lag of 5 ms


@pytest.mark.slow
def test_motors_of_first_order_have_no_inertia(tmp_path: Path) -> None:
    recorded, causes = campaign(tmp_path / "c", "none")
    assert causes == {}
    found = diagnose(recorded)
    assert found.verdict is not Verdict.UNKNOWN
    for effect in found.effects:  # the simulator's motors have a lag of 5 ms, which resembles a delay
        assert {effect.name, *effect.confounded_with} & {"wheel_lag", "actuation_delay"}
        assert "form" not in effect.evidence
        assert max(parameter.value for parameter in effect.parameters.values()) < 0.012
