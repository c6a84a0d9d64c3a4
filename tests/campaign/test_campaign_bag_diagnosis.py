"""Bags of simulated vehicles, from the guess of their mapping to the diagnosis of the campaign."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ros_bags import BEGAN_NS, Make, Sent, write_bag

from agvbench.campaign import Campaign
from agvbench.cli import main
from agvbench.simulator.plants import differential_plant, make_plant

RATE_HZ, HELD, SECONDS, BAGS = 50, 5, 80, 4
Publish = Callable[[int, np.ndarray], list[Sent]]


def wander(rng: np.random.Generator, middle: float, size: float, every_s: float) -> np.ndarray:
    """Return commands at 10 Hz that wander about `middle`."""
    t_s = np.arange(SECONDS * RATE_HZ // HELD) * HELD / RATE_HZ
    knots = np.arange(0.0, SECONDS + 2.0 * every_s, every_s)
    return middle + size * np.interp(t_s, knots, rng.uniform(-1.0, 1.0, len(knots)))


def drive(plant, commands: np.ndarray, began_ns: int, publish: Publish, pose: str, rng) -> list[Sent]:
    """Drive the plant by commands (n, 3) at 10 Hz; return poses at 50 Hz, with 0.3 mm and 0.5 mrad of noise."""
    plant.reset((0.0, 0.0, 0.3), seed=1)
    sent = []
    for row in range(len(commands) * HELD):
        ns = began_ns + row * 10**9 // RATE_HZ
        if row % HELD == 0:
            sent += publish(ns, commands[row // HELD])
        x, y, heading = plant.advance(*commands[row // HELD], 1.0 / RATE_HZ) + rng.normal(size=3) * [3e-4, 3e-4, 5e-4]
        at = ns + 10**9 // RATE_HZ
        sent.append(Sent(at, "/pose", lambda make, at=at, p=(x, y, heading): getattr(make, pose)(at, *p)))
    return sent


def twist(ns: int, command: np.ndarray) -> list[Sent]:
    return [Sent(ns, "/cmd_vel", lambda make: make.twist(*command[:2].tolist()))]


def pulses(ns: int, command: np.ndarray) -> list[Sent]:
    def number(value: float) -> Callable[[Make], object]:
        return lambda make: make.number(value)

    topics = ("/pwm/drive", "/pwm/steer_front", "/pwm/steer_rear")
    return [Sent(ns, topic, number(value)) for topic, value in zip(topics, command.tolist(), strict=True)]


def recorded(folder: Path, kind: str, *, is_differential: bool) -> list[Path]:
    bags = []
    for number in range(BAGS):
        rng = np.random.default_rng([5, number])
        if is_differential:
            speed, yaw_rate = wander(rng, 0.35, 0.2, 1.7), wander(rng, 0.0, 0.9, 1.1)
            commands, plant = np.column_stack([speed, yaw_rate, yaw_rate]), differential_plant(3)
        else:
            drives = wander(rng, 1800.0, 80.0, 1.7), wander(rng, 1500.0, 250.0, 1.1), wander(rng, 1500.0, 200.0, 1.3)
            commands, plant = np.round(np.column_stack(drives)), make_plant(3)
        publish, pose = (twist, "odometry") if is_differential else (pulses, "pose_stamped")
        sent = drive(plant, commands, BEGAN_NS + number * 600 * 10**9, publish, pose, rng)
        bags.append(write_bag(folder, f"drive_{number}", kind, sent))
    return bags


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "is_differential"), [("mcap", True), ("ros1", False)])
def test_bags_are_guessed_imported_and_diagnosed(kind, is_differential, tmp_path, capsys):
    bags = list(map(str, recorded(tmp_path, kind, is_differential=is_differential)))
    mapping, out, answer = (str(tmp_path / name) for name in ("mapping.toml", "c", "answer.json"))
    assert main(["import", "--guess", bags[0], "--out", mapping]) == 0
    assert main(["import", "--mapping", mapping, *bags, "--out", out]) == 0
    campaign = Campaign.open(out)
    assert campaign.header.geometry.is_differential is is_differential
    assert campaign.runs["session"].nunique() == BAGS
    assert sum(len(run.frames) for run in campaign) == BAGS * SECONDS * RATE_HZ
    assert main(["diagnose", out, "--json", answer]) == 0
    found = json.loads(Path(answer).read_text(encoding="utf-8"))
    assert found["verdict"] != "NOT_IDENTIFIABLE"
    assert found["held_out"]["runs"] > 0
    error, before = (found["held_out"]["position_rms_mm"][name] for name in ("after", "before"))
    assert error < before
