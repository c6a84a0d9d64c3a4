"""The supervisor: a vehicle is stopped when it is lost, frozen, somebody else, or about to leave the floor."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.adapters import open_rig
from agvbench.bus.keys import Keys
from agvbench.errors import SafetyStopError
from agvbench.planning import Workspace
from agvbench.running.execution.drive import drive
from agvbench.running.supervision.limits import DEFAULT_SAFETY, SafetyLimits
from agvbench.running.supervision.rule import Slice
from agvbench.running.supervision.rules.frozen import FrozenRule
from agvbench.running.supervision.rules.jump import JumpRule
from agvbench.running.supervision.rules.lost import LostRule
from agvbench.running.supervision.rules.volume import VolumeRule
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Command, Commands, Frames, Pose

PLANTS = Path(__file__).with_name("runaway_plants.py")
NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(-1.5, 0.0, 0.0)
ROOM = Workspace.circle(6.1)


def stopped(
    plant: str,
    camera: dict[str, float] | None = None,
    room: Workspace = ROOM,
    limits: SafetyLimits = DEFAULT_SAFETY,
) -> tuple[str, Frames]:
    """Drive straight on for 14 s; return why it was stopped, and what was seen, also in the second after."""
    commands = Commands(*np.array([[0.0, 14.0], [1900.0, 1500.0], [1500.0, 1500.0], [1500.0, 1500.0]]))
    seen: list[Frames] = []
    with open_rig("sim", plant=f"{PLANTS}:{plant}", camera=camera or {}) as link:
        supervisor = Supervisor(room, NEUTRAL, limits)
        with pytest.raises(SafetyStopError) as caught:
            drive(link, commands, neutral=NEUTRAL, start=START, run_key="a", supervisor=supervisor, seen=seen)
        until_s = float(max(frames.t_s.max() for frames in seen if len(frames)))
        simulated_s = max(_end_s(str(caught.value)), limits.control_cycle_s)
        seen.append(link.control_cycle(NEUTRAL, t_s=simulated_s, hold_s=1.0))
    frames = Frames.concatenate(seen)
    assert until_s < 14.0
    return str(caught.value), frames


def _end_s(said: str) -> float:
    return float(said.partition("stopped ")[2].partition(" s into")[0])


def test_a_vehicle_comes_to_rest_before_the_edge() -> None:
    said, frames = stopped("Straight")
    assert "vehicle is leaving the capture volume: would come to rest" in said
    assert 2.5 < np.nanmedian(frames.x_m[-20:]) < 3.05


def test_a_vehicle_that_nobody_sees_is_stopped() -> None:
    said, _ = stopped("Straight", {"untracked": 0.5, "burst_frames": 1e4})
    assert "tracking was lost: not seen for 0." in said
    assert _end_s(said) <= 0.7


def test_a_vehicle_that_is_taken_for_another_is_stopped() -> None:
    said, _ = stopped("Swapped")
    assert "pose jumped: 0.80 m from where the vehicle was going (limit: 0.3 m)" in said
    assert 1.0 <= _end_s(said) <= 1.3


def test_what_is_exchanged_for_longer_is_judged_just_as_often() -> None:
    told = {
        control_cycle_s: stopped("Swapped", limits=SafetyLimits(control_cycle_s=control_cycle_s))[0]
        for control_cycle_s in (0.1, 5.0)
    }
    assert told[0.1] == told[5.0]


def seen_at(t_s: np.ndarray, x_m: np.ndarray, driving_s: float = 10.0) -> Slice:
    """Return a slice along the x axis."""
    return Slice(t_s, np.column_stack([x_m, np.zeros((len(t_s), 2))]), float(t_s[-1]) + 0.01, driving_s)


def slices(x_m: np.ndarray, driving_s: float = 10.0) -> list[Slice]:
    """Return slices of 0.1 s at 120 Hz."""
    t_s = np.arange(len(x_m)) / 120.0
    return [seen_at(t_s[i : i + 12], x_m[i : i + 12], driving_s) for i in range(0, len(x_m), 12)]


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.floats(-1.0, 1.0), st.floats(1e-4, 2e-3))
def test_a_vehicle_that_drives_about_is_not_stopped(seed: int, speed: float, start_m: float, noise_m: float) -> None:
    rng = np.random.default_rng(seed)
    t_s = np.arange(240) / 120.0
    x_m = start_m + speed * np.where(t_s < 1.0, t_s, 2.0 - t_s) + noise_m * rng.standard_normal(240)
    x_m[rng.integers(240, size=3)] += rng.uniform(-3.0, 3.0, 3)  # single wrong frames
    for rule in (LostRule, FrozenRule, JumpRule, VolumeRule):
        watching = rule(DEFAULT_SAFETY, Workspace.circle(8.0))
        assert [watching.complaint(one) for one in slices(x_m)] == [None] * 20


def test_a_camera_that_repeats_itself_is_noticed_if_it_flickered_before() -> None:
    flicker = 1e-4 * np.random.default_rng(0).standard_normal(60)
    frozen = np.concatenate([flicker, np.full(120, 0.5)])
    watching = FrozenRule(DEFAULT_SAFETY, ROOM)
    said = [watching.complaint(one) for one in slices(frozen)]
    first = next(index for index, one in enumerate(said) if one)
    assert 10 <= first <= 11  # half a second after it froze, and a slice
    watching = FrozenRule(DEFAULT_SAFETY, ROOM)
    assert not any(watching.complaint(one) for one in slices(np.full(240, 0.5)))
    watching = FrozenRule(DEFAULT_SAFETY, ROOM)
    assert not any(watching.complaint(one) for one in slices(frozen, driving_s=0.0))


class Scripted:
    """A link on which these frames arrive."""

    def __init__(self, frames: Frames) -> None:
        self.keys, self._frames, self.stops = Keys("lab", "agv1"), frames, 0

    def control_cycle(self, _: Command, *, t_s: float, hold_s: float) -> Frames:
        """Return the frames that arrive in the interval."""
        received = self._frames.received_s
        return self._frames.select((received >= t_s) & (received < t_s + hold_s))

    def stop(self) -> None:
        """Count."""
        self.stops += 1


@pytest.mark.parametrize(
    ("late_s", "aside_m"), [(0.45, 0.0), (0.0, 0.8), (-2.0, 0.0), (0.0, 40.0)], ids=["late", "wrong", "ahead", "far"]
)
@pytest.mark.parametrize("rate_hz", [120.0, 30.0])
def test_a_lone_late_or_wrong_frame_stops_nobody(late_s: float, aside_m: float, rate_hz: float) -> None:
    t_s = np.arange(0.0, 3.0, 1.0 / rate_hz)
    x_m = 0.3 * t_s + 1e-4 * np.random.default_rng(0).standard_normal(len(t_s))
    tracked = (t_s < 1.3) | (t_s > 1.7)
    lone = int(1.5 * rate_hz)
    tracked[lone], x_m[lone] = True, x_m[lone] - 0.3 * late_s
    captured_s, y_m, zeros = t_s.copy(), np.zeros(len(t_s)), np.zeros(len(t_s))
    captured_s[lone] -= late_s
    y_m[lone] = aside_m
    link = Scripted(Frames(captured_s, x_m, y_m, zeros, tracked, np.arange(len(t_s)), zeros, t_s))
    watching = Supervisor(ROOM, NEUTRAL)
    watching.control_cycle(link, Command(1900.0, 1500.0, 1500.0), t_s=0.0, hold_s=3.0, seen=[])
    assert link.stops == 0


@pytest.mark.parametrize(("turns_on_the_spot", "stops"), [(True, 1), (False, 0)])
def test_a_camera_that_freezes_while_the_vehicle_turns_on_the_spot_is_noticed(turns_on_the_spot, stops) -> None:
    t_s = np.arange(0.0, 3.0, 0.02)
    heading, zeros = np.where(t_s < 0.5, t_s, 0.5), np.zeros(len(t_s))
    link = Scripted(Frames(t_s, zeros, zeros, heading, t_s >= 0.0, np.arange(len(t_s)), zeros, t_s))
    watching = Supervisor(ROOM, Command(0.0, 0.0, 0.0), turns_on_the_spot=turns_on_the_spot)
    caught = pytest.raises(SafetyStopError, match="tracking is frozen") if stops else nullcontext()
    with caught:
        watching.control_cycle(link, Command(0.0, 1.0, 0.0), t_s=0.0, hold_s=3.0, seen=[])
    assert link.stops == stops
