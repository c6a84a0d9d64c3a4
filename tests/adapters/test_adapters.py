"""What every adapter must do, whichever it is: a new one inherits these tests."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from rig_driving import NEUTRAL, START, TINY

from agvbench.adapters import AdapterOptions
from agvbench.adapters.contract import AgvAdapter
from agvbench.adapters.registry import agv_adapters, mocap_adapters, open_agv, open_mocap, parse_spec
from agvbench.adapters.serial_line import conversation
from agvbench.adapters.simavr.firmware_files import why_not_built
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.identity import decode_agv_identity, decode_mocap_identity
from agvbench.bus.messages.request import Replay, Reset, Sampling
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import AgvbenchError, LinkError
from agvbench.types import Command, Commands, Frames

OPTIONS = AdapterOptions(plant=TINY)
RESET = Reset("a", START, Sampling(120.0, 0.001))
# Adapters that need nothing but this machine; others need hardware, and are held to the contract where it is.
NEED_NOTHING = (".sim", ".live", ".simavr", ".simavr_live")
AGV_HERE = [scheme for scheme, adapter in agv_adapters().items() if adapter.__module__.endswith(NEED_NOTHING)]
# What every camera must do, simulated or not, is in test_contract_checks.py.
MOCAP_HERE = [scheme for scheme, adapter in mocap_adapters().items() if adapter.__module__.endswith(".sim")]


class Heard:
    """Stands where the host stands: keeps what the adapter reports."""

    def __init__(self) -> None:
        self.truths: list[Truth] = []
        self.batches: list[Frames] = []
        self.saw_something = threading.Event()

    def truth(self, t_s: Any, poses: Any, *, end_s: float, acknowledged: int = 0, flags: Any = TruthFlags.LAST) -> None:
        self.truths.append(Truth(len(self.truths) + 1, acknowledged, end_s, t_s, poses, flags))
        self.saw_something.set()

    def frames(self, frames: Frames, *, clock: Any, acknowledged: int = 0) -> None:
        self.batches.append(frames)

    def event(self, level: Any, kind: str, text: str, *, acknowledged: int = 0) -> None:
        assert level != Level.ERROR, text

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        raise AssertionError(error)


@pytest.fixture(params=AGV_HERE)
def agv(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(conversation, "ANSWER_LIMIT_S", 10.0)  # a busy machine may keep a simulated vehicle waiting
    if request.param.startswith("simavr") and (why := why_not_built()):
        pytest.skip(why)
    adapter = open_agv(request.param, OPTIONS)
    adapter.heard = Heard()  # type: ignore[attr-defined]
    adapter.start(adapter.heard)  # type: ignore[attr-defined]
    yield adapter
    adapter.stop()
    adapter.close()


@pytest.mark.parametrize("adapters", [agv_adapters(), mocap_adapters()], ids=["agv", "mocap"])
def test_adapters_are_documented_and_named_by_their_scheme(adapters: dict[str, type]) -> None:
    assert "sim" in adapters
    for scheme, adapter in adapters.items():
        assert parse_spec(scheme) == (scheme, "")
        assert adapter.__doc__
        assert sys.modules[adapter.__module__].__doc__


def test_identity_survives_the_bus_and_stays(agv: AgvAdapter) -> None:
    identity = agv.identity()
    assert decode_agv_identity(encode(identity)) == identity
    agv.reset(RESET)
    agv.apply(CommandMessage(1, 0.0, NEUTRAL, 0.05))
    assert agv.identity() == identity
    assert identity.vehicle == OPTIONS.vehicle


@pytest.mark.real_time
def test_the_vehicle_stands_still_until_it_is_driven_and_moves_then(agv: Any) -> None:
    agv.reset(RESET)
    agv.apply(CommandMessage(1, 0.0, NEUTRAL, 0.1))
    assert agv.heard.saw_something.wait(10.0)
    # Neutral pulses of the firmware are 0.3 µs wide of it: a vehicle without a dead band creeps.
    assert np.allclose(agv.heard.truths[0].poses[0], START, atol=1e-3)
    agv.apply(CommandMessage(2, 0.1, Command(1900.0, 1500.0, 1500.0), 0.5))
    moved = threading.Event()
    for _ in range(500):
        if moved.wait(0.01) or np.hypot(*(agv.heard.truths[-1].poses[-1, :2] - START[:2])) > 0.01:
            return
    pytest.fail("the vehicle did not move")


@pytest.mark.real_time
def test_stop_may_come_at_any_time_and_twice(agv: Any) -> None:
    agv.stop()
    agv.reset(RESET)
    agv.stop()
    agv.apply(CommandMessage(1, 0.0, NEUTRAL, 0.05))
    agv.stop()
    agv.stop()
    agv.reset(replace(RESET, run_key="b"))
    agv.apply(CommandMessage(2, 0.0, NEUTRAL, 0.05, CommandFlags.NONE))


@pytest.mark.real_time
def test_replay_of_nothing_and_of_something(agv: Any) -> None:
    none = np.empty(0)
    agv.replay(Replay(RESET, Commands(none, none, none, none), 0.0))
    one = np.zeros(1)
    agv.replay(Replay(RESET, Commands(one, one + 1500.0, one + 1500.0, one + 1500.0), 1.0))


@pytest.mark.parametrize("scheme", MOCAP_HERE)
def test_a_simulated_camera_answers_every_exchange(scheme: str) -> None:
    camera, heard = open_mocap(scheme, OPTIONS), Heard()
    camera.start(heard)
    identity = camera.identity()
    assert decode_mocap_identity(encode(identity)) == identity
    sampling = camera.reset(RESET)
    assert sampling.rate_hz == identity.rate_hz
    assert 0.0 <= sampling.phase_s < 1.0 / sampling.rate_hz
    for count in (0, 1, 50):
        t_s = np.arange(count) / 120.0
        camera.see(Truth(1, 1, 1.0, t_s, np.zeros((count, 3))))
    assert len(heard.batches) == 3
    camera.close()


def test_a_camera_that_was_not_reset_and_a_vehicle_that_was_not_placed_say_so() -> None:
    camera, vehicle = open_mocap("sim", OPTIONS), open_agv("sim", OPTIONS)
    with pytest.raises(LinkError, match="not reset before its first frame"):
        camera.see(Truth(1, 1, 1.0, np.zeros(1), np.zeros((1, 3))))
    with pytest.raises(LinkError, match="not placed before its first command"):
        vehicle.apply(CommandMessage(1, 0.0, NEUTRAL, 0.1))


@pytest.mark.parametrize("spec", ["", ":", "simm", "nothing:here", "sim:", "sim:no_such_module:factory"])
def test_a_specification_that_names_nothing_is_one_line(spec: str) -> None:
    if parse_spec(spec)[0] == "sim" and not parse_spec(spec)[1]:
        open_agv(spec, OPTIONS).close()
        return
    with pytest.raises(AgvbenchError) as caught:
        open_agv(spec, OPTIONS)
    assert "\n" not in str(caught.value)


def test_command_line_modules_import_nothing_heavy() -> None:
    code = (
        "import sys, json; from agvbench.cli.laboratory import agv, mocap, sim;"
        "print(json.dumps([m for m in ('numpy', 'zenoh', 'pandas', 'numba') if m in sys.modules]))"
    )
    assert json.loads(subprocess.check_output([sys.executable, "-c", code])) == []
