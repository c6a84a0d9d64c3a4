"""Effects of the user's own folder are listed and simulated; nothing else is executed."""

from __future__ import annotations

import pytest
from own_effect import PROGRAM, python, write

from agvbench.effects import SteeringLag
from agvbench.effects.registry import OWN_EFFECTS
from agvbench.errors import FileError


def test_a_name_of_the_library_is_taken(own, tmp_path):
    write(tmp_path, '"lateral_load_loss"', '"steering_lag"')
    with pytest.raises(FileError, match=r"there is an effect of this name: steering_lag; rename it$"):
        own([SteeringLag])


def test_only_effects_are_executed_and_nothing_in_a_campaign(tmp_path, monkeypatch):
    path = write(tmp_path)
    (path.parent / "game.py").write_text("raise SystemExit('no effect')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert [str(file) for file in OWN_EFFECTS.files()] == ["effects/lateral_load_loss.py"]
    (tmp_path / "run").mkdir()
    (tmp_path / "campaign.toml").write_text("", encoding="utf-8")
    assert OWN_EFFECTS.files() == []
    write(tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    assert OWN_EFFECTS.files() == []


@pytest.mark.slow
def test_an_own_effect_is_listed_and_simulated_and_compiled_again_when_it_changes(tmp_path):
    write(tmp_path)
    listed = python(tmp_path, "-m", "agvbench", "effects")
    assert listed.returncode == 0, listed.stderr
    assert "lateral_load_loss" in listed.stdout
    assert listed.stderr.startswith("own effects: effects/lateral_load_loss.py\n")
    ratios = []
    for gain in ("1.0 - loss", "1.0 - 0.5 * loss"):
        write(tmp_path, "1.0 - loss", gain)
        simulated = python(tmp_path, "-c", PROGRAM)
        assert simulated.returncode == 0, simulated.stderr
        without, with_effect = map(float, simulated.stdout.split())
        ratios.append(1.0 - with_effect / without)
    # 1 − v / v₀ = loss u ψ̇ with u = 0.3 cos 0.4 m/s and ψ̇ = u tan 0.4 / 0.3 m, where each axle is driven equally.
    assert ratios[0] == pytest.approx(2.0 * ratios[1], rel=0.02)
    assert 0.09 < ratios[0] < 0.13
