"""The whole loop: bus, serial protocol, firmware, pulses, plant, camera packets, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters import AdapterOptions, open_rig
from agvbench.adapters.registry import open_agv
from agvbench.errors import LinkError
from agvbench.types import Command, Frames, Pose
from agvbench.vehicle.channels import Channels

PERFECT = dict.fromkeys(("lost", "doubled", "late", "wrong", "untracked", "marker_noise_m", "latency_s"), 0.0)
NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(0.5, -0.25, 0.75)

pytestmark = pytest.mark.usefixtures("firmware")


class SlopingPlant:
    """Drives straight along x, 1 mm/s a microsecond above neutral: its pose tells every pulse."""

    def __init__(self, seed: int) -> None:
        self.x_m = 0.0

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        self.x_m, self.y_m, self.heading_rad = pose

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        self.x_m += dt * (drive - 1500.0) / 1000.0
        return self.x_m, self.y_m, self.heading_rad


PLANT = f"{__file__}:SlopingPlant"


def drive(agv: str, holds_s: tuple[float, ...], *, key: str = "a", seed: int = 0, mocap: str = "sim") -> Frames:
    with open_rig(agv=agv, mocap=mocap, plant=PLANT, seed=seed, camera=PERFECT) as link:
        link.reset(START, run_key=key)
        parts, t_s = [link.control_cycle(NEUTRAL, t_s=-0.5, hold_s=0.5)], 0.0
        for hold_s in holds_s:
            parts.append(link.control_cycle(Command(1800.0, 1400.0, 1600.0), t_s=t_s, hold_s=hold_s))
            t_s += hold_s
        parts += [link.control_cycle(NEUTRAL, t_s=t_s, hold_s=0.3), link.flush()]
    return Frames.concatenate(parts)


@pytest.mark.parametrize("agv", ["simavr:1", "simavr:2"])
def test_the_vehicle_moves_as_far_as_its_pulses_say_and_as_late(agv: str) -> None:
    frames = drive(agv, (1.0,))
    moved_m = float(frames.x_m[-1] - START.x_m)
    # Whole degrees make 1793.3 or 1806.7 µs of 1800; both edges of the drive are late by up to a frame and a pulse.
    assert moved_m == pytest.approx(0.3, abs=0.3 * 0.025 + 0.3 * 0.021)
    began_s = frames.t_s[np.argmax(frames.x_m > START.x_m + 1e-4)]
    assert 0.0 < began_s < 0.035


@pytest.mark.parametrize("agv", ["simavr:1", "simavr:2"])
def test_seed_and_key_decide_everything_and_the_cut_of_a_hold_nothing(agv: str) -> None:
    first = drive(agv, (1.0,))
    for again in (drive(agv, (1.0,)), drive(agv, (0.3, 0.05, 0.65))):
        assert np.array_equal(again.x_m, first.x_m)
        assert np.array_equal(again.t_s, first.t_s)
    assert not np.array_equal(drive(agv, (1.0,), key="b").x_m, first.x_m)
    assert not np.array_equal(drive(agv, (1.0,), seed=1).x_m, first.x_m)


def test_a_run_does_not_depend_on_what_was_driven_before() -> None:
    with open_rig(agv="simavr", plant=PLANT, camera=PERFECT) as link:
        ends = []
        for key in ("a", "b", "a"):
            link.reset(START, run_key=key)
            link.control_cycle(Command(1800.0, 1500.0, 1500.0), t_s=0.0, hold_s=0.31)
            ends.append(float(link.control_cycle(NEUTRAL, t_s=0.31, hold_s=0.2).x_m[-1]))
    assert ends[0] == ends[2] != ends[1]


def test_a_phase_that_is_given_is_the_same_in_every_run() -> None:
    ends = [drive("simavr:2,phase_ms=3", (1.0,), key=key).x_m[-1] for key in ("a", "b")]
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)  # neutral is wide by 0.3 µs, and the camera looks when it looks
    # 1.01 s are half a frame more than whole frames: the drive lasts 51 frames of 20 ms or 50, by the phase alone.
    moved_m = [
        float(np.ptp(drive(f"simavr:2,phase_ms={phase_ms}", (1.01,)).x_m)) for phase_ms in (0, 5, 10, 15)
    ]  # fmt: skip
    assert {round(one / 0.3 / 0.02) for one in moved_m} == {50, 51}


def test_the_camera_may_speak_natnet() -> None:
    frames = drive("simavr", (0.5,), mocap="natnet:emulated")
    assert float(frames.x_m[-1] - frames.x_m[0]) == pytest.approx(0.15, abs=0.01)


@pytest.mark.parametrize(
    ("spec", "options", "line"),
    [
        ("simavr:3", AdapterOptions(plant=PLANT), "simavr: no such firmware: '3' (one of: 1, 2)"),
        ("simavr:1,9", AdapterOptions(plant=PLANT), "simavr: no such firmware: '9' (one of: 1, 2)"),
        ("simavr:2,phase_ms=20", AdapterOptions(plant=PLANT), "phase_ms=20 (limit: 0 to below 20 ms)"),
        ("simavr:2,phase_ms=x", AdapterOptions(plant=PLANT), "no such phase of the servo frame: phase_ms=x"),
        ("simavr", AdapterOptions(plant=PLANT, channels=Channels.alike("normalised")), "takes microseconds"),
    ],
)
def test_what_cannot_be_opened_is_one_line(spec: str, options: AdapterOptions, line: str) -> None:
    with pytest.raises(LinkError) as caught:
        open_agv(spec, options)
    assert line in str(caught.value)


def test_a_pulse_out_of_range_is_one_line_and_the_rig_goes_on() -> None:
    with open_rig(agv="simavr", plant=PLANT, camera=PERFECT) as link:
        link.reset(START, run_key="a")
        with pytest.raises(
            LinkError, match=r"drive pulse is out of what the firmware takes: 3000 µs \(limit: 600 to 2400"
        ):
            link.control_cycle(Command(3000.0, 1500.0, 1500.0), t_s=0.0, hold_s=0.1)
        link.reset(START, run_key="b")
        assert len(link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.1))


def test_without_the_built_firmware_the_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from agvbench.adapters.simavr import firmware_files as built

    monkeypatch.setattr(built, "build_directory", lambda: tmp_path)
    with pytest.raises(LinkError, match=r"not built: simavr_host; run agvbench firmware"):
        open_agv("simavr", AdapterOptions(plant=PLANT))
    monkeypatch.setattr(built, "PACKAGES", {"/nowhere/io.h": "avr-libc"})
    with pytest.raises(LinkError, match="install avr-libc, then run agvbench firmware"):
        open_agv("simavr", AdapterOptions(plant=PLANT))
