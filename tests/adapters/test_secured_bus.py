"""A bus with certificates and rules, set up as the how-to says: who is known drives, others do not, some only watch."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest
from rig_driving import NEUTRAL, START, TINY, process
from secured_lab import set_up

from agvbench.adapters import open_rig
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.keys import AGV, IDENTITY, Keys
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.runner_state import Phase, RunnerState
from agvbench.bus.queries import ask
from agvbench.bus.session import open_bus_session
from agvbench.bus.state_follower import StateFollower, find_runners
from agvbench.campaign import Campaign
from agvbench.errors import AdapterGoneError, LinkError, PlantError
from agvbench.running.configuration.settings import BenchSettings
from agvbench.workflows.doctor import FindingState, Lab, examine

KEYS = Keys("lab", "agv1")
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates"),
]


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return set_up(tmp_path_factory.mktemp("lab"))


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tls/127.0.0.1:{probe.getsockname()[1]}"


def until(condition: Callable[[], bool], limit_s: float = 10.0) -> bool:
    deadline_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.01)
    return condition()


def stand(link: VehicleLink, steps: range) -> None:
    for step in steps:
        link.control_cycle(NEUTRAL, t_s=0.1 * step, hold_s=0.1)


@pytest.mark.slow
def test_a_campaign_with_vehicle_camera_and_bench_on_a_secured_bus(
    machines: dict[str, Path], endpoint: str, tmp_path: Path
) -> None:
    vehicle, camera = ("agv", "sim", "--listen", endpoint), ("mocap", "sim", "--connect", endpoint)
    bench = [
        sys.executable, "-c", "from agvbench.cli import main; raise SystemExit(main())", "bench", "trajectories",
        "-k", "uncalibrated and 5-", "--repeats", "1", "--no-report", "--connect", endpoint,
        "--bus-config", str(machines["bench-pc"]), "--out", str(tmp_path / "secured"),
    ]  # fmt: skip
    with (
        process(*vehicle, "--bus-config", str(machines["vehicle-pc"])),
        process(*camera, "--bus-config", str(machines["camera-pc"])),
    ):
        done = subprocess.run(bench, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    (run,) = Campaign.open(tmp_path / "secured").select()
    assert len(run.frames) > 100


def _name_a_certificate_that_signs_nothing(config: Path, folder: Path) -> None:
    text = config.read_text()
    authority = re.search(r'root_ca_certificate:\s*"([^"]+)"', text)
    own = next(file for file in folder.rglob("*bench-pc*") if "BEGIN CERT" in file.read_text())
    assert authority is not None
    config.write_text(text.replace(authority[1], str(own)))


def test_the_doctor_looks_at_certificates_before_anybody_is_called(tmp_path: Path) -> None:
    config = set_up(tmp_path)["bench-pc"]
    lab = Lab(BenchSettings(bus_config=str(config)), tmp_path)
    finding = dict(examine(lab))["certificates"]
    assert finding.state is FindingState.GOOD
    assert "requires a certificate of the lab; its authority ends in" in finding.found
    _name_a_certificate_that_signs_nothing(config, tmp_path)
    finding = dict(examine(lab))["certificates"]
    assert (finding.state, "is no authority's" in finding.found) == (FindingState.DOUBTFUL, True)
    for file in tmp_path.rglob("*bench-pc*"):
        if file.suffix not in (".json5",):
            file.write_text("nothing of use")
    finding = dict(examine(lab))["certificates"]
    assert (finding.state, "cannot be used" in finding.found) == (FindingState.BAD, True)


def test_who_shows_no_certificate_or_a_strangers_is_refused(
    machines: dict[str, Path], endpoint: str, tmp_path: Path
) -> None:
    strangers = set_up(tmp_path)
    nameless = tmp_path / "nameless.json5"
    authority = machines["bench-pc"].parent / "authority.pem"
    nameless.write_text(f'{{transport: {{link: {{tls: {{root_ca_certificate: "{authority}"}}}}}}}}')
    known = BusConfig.load(machines["vehicle-pc"])
    with open_bus_session(listen=[endpoint], config=known):
        for config, reason in ((nameless, "certificate required"), (strangers["bench-pc"], "its certificate: ")):
            with pytest.raises(LinkError, match=f"connect {endpoint}: refused: .*{reason}"):
                open_bus_session(connect=[endpoint], config=BusConfig.load(config), timeout_s=0.5)
        plain = endpoint.replace("tls", "tcp")
        with pytest.raises(LinkError, match="no answer"):
            open_bus_session(connect=[plain], timeout_s=0.5)
        with open_bus_session(connect=[endpoint], config=BusConfig.load(machines["bench-pc"])) as session:
            assert list(session.info.links())


def test_who_may_only_listen_watches_a_bench_and_cannot_pretend_to_be_one(
    machines: dict[str, Path], endpoint: str
) -> None:
    state = partial(RunnerState, campaign="monday", version="1.0", phase=Phase.DRIVING, began_unix_s=0.0, elapsed_s=0.0)
    with (
        process("sim", "--plant", TINY, "--listen", endpoint, "--bus-config", str(machines["vehicle-pc"])),
        open_rig(connect=endpoint, bus_config=BusConfig.load(machines["bench-pc"])) as link,
        closing(link.publish_state(state)),
        open_bus_session(connect=[endpoint], config=BusConfig.load(machines["hall-display"])) as display,
        open_bus_session(connect=[endpoint], config=BusConfig.load(machines["hall-display"])) as other_display,
    ):
        (first,) = find_runners(display, limit_s=5.0).values()
        with StateFollower(display, KEYS, first) as follower:
            states = follower.states(5.0)
            next(states)
            other_display.put(KEYS.state, encode(state(2**32, first.source, campaign="pretended")))
            seen = [next(states) for _ in range(3)]
        assert {one.campaign for one in seen if one is not None} == {"monday"}
        assert None not in seen


def test_who_may_only_listen_hears_everything_and_commands_nothing(machines: dict[str, Path], endpoint: str) -> None:
    heard: list[str] = []
    made_up = encode(Event(1, AGV, Level.ERROR, "PlantError", "made up"))
    bench = BusConfig.load(machines["bench-pc"])
    with (
        process("sim", "--plant", TINY, "--listen", endpoint, "--bus-config", str(machines["vehicle-pc"])),
        open_bus_session(connect=[endpoint], config=BusConfig.load(machines["hall-display"])) as display,
        open_bus_session(connect=[endpoint], config=bench) as second_bench,
        open_rig(connect=endpoint, bus_config=bench) as link,
    ):
        subscriber = display.declare_subscriber(KEYS.report, lambda sample: heard.append(str(sample.key_expr)))
        link.reset(START, run_key="a")
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.1)
        assert until(lambda: KEYS.report in heard)
        subscriber.undeclare()
        # It reaches neither the vehicle (a command that leaps in time is answered by an error) nor the bench.
        display.put(KEYS.command, encode(CommandMessage(1, 9.0, NEUTRAL, 0.1, CommandFlags.NONE, 77)))
        display.put(KEYS.report, made_up)
        with pytest.raises(AdapterGoneError, match="no answer"):
            ask(display, KEYS.queryable(AGV, IDENTITY), b"", 0.3)
        stand(link, range(1, 20))
        # The rules kept them away, not the way they were sent.
        assert ask(second_bench, KEYS.queryable(AGV, IDENTITY), b"", 5.0)
        second_bench.put(KEYS.report, made_up)
        with pytest.raises(PlantError, match="made up"):
            stand(link, range(20, 500))
