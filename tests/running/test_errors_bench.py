"""Bad input to a bench session: one line each, word for word as the documents have it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.control import PurePursuit
from agvbench.errors import AgvbenchError
from agvbench.model import example_path
from agvbench.running.configuration.benchmark_files import find_benchmark
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.execution.calibration import calibrate_campaign
from agvbench.running.session.driver import Driver
from agvbench.running.session.opening import open_session
from agvbench.vehicle.channels import Channels
from agvbench.workflows.init import make_lab

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "errors-bench.md"
ROWS = dict(re.findall(r"^\| (.+?) \| `(.+)` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))

HEADER = CampaignHeader(1, "full", "agv1", 0.181, 0.121, Channels.alike("us"), 120.0)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").touch()


def opened(out="new", *, resume=False, dry_run=False, **given):
    def act():
        with open_session(given, out=out, resume=resume, dry_run=dry_run):
            pass

    return act


def resumed_with_another_seed():
    Path("begun").mkdir()
    BenchSettings(seed=1).save(Path("begun"))
    opened("begun", resume=True, seed=2)()


def resumed_elsewhere():
    Path("begun").mkdir()
    BenchSettings().save(Path("begun"))
    opened("begum", resume=True)()


def resumed_without(name):
    def act():
        CampaignWriter.create("begun", HEADER)
        BenchSettings().save(Path("begun"))
        Path("begun/runs.parquet/left.parquet").touch()
        Path("begun", name).unlink()
        opened("begun", resume=True)()

    return act


def resumed_with_another_name():
    Path("begun").mkdir()
    BenchSettings().save(Path("begun"))
    opened("begun", resume=True, vehicle_name="red")()


def over_the_bus_in_another_unit(monkeypatch):
    """A vehicle that says of itself that it takes µs, as one in another process would."""
    from agvbench.running.session import rig_checks

    real = rig_checks.open_rig

    def in_microseconds(**options):
        return real(**options | {"channels": Channels.alike("us")})

    monkeypatch.setattr(rig_checks, "open_rig", in_microseconds)
    opened(vehicle=str(example_path("front_steered")), plant="agvbench.simulator:random_plant")()


def driven(**arguments):
    def act():
        with open_session({}, out="new", resume=False, dry_run=True) as session:
            driver = Driver(session, "run", experiment="free", repeat=1)
            driver.trajectory(**arguments) if "name" in arguments else driver.hold(**arguments)

    return act


def controlled(name, make_controller, **more):
    def act():
        with open_session({}, out="new", resume=False, dry_run=True) as session:
            driver = Driver(session, "run", experiment="free", repeat=1)
            driver.controlled(name, make_controller, condition="uncalibrated", **more)

    return act


def without_gain(_):
    return {}["gain"]


def calibrated_from_nothing():
    Path("full/something").unlink()
    calibrate_campaign(CampaignWriter.create("full", HEADER), maps="default")


CASES = {
    "`--repeats -1`": opened(repeats=-1),
    "`--repeats 1001`": opened(repeats=1001),
    "`--attempts 0`": opened(attempts=0),
    "`--seed -1`": opened(seed=-1),
    "`--order odd`": opened(order="odd"),
    "`--maps spline`": opened(maps="spline"),
    "`--place operator`": opened(place="operator"),
    "`--place crane`": opened(place="crane"),
    "`--exchange 0.01`": opened(exchange=0.01),
    "`--agv live --exchange 2`": opened(agv="live", exchange=2.0),
    "`--session tuesday`, simulated": opened(session="tuesday"),
    "`--camera rate_hz=15`": opened(camera="rate_hz=15"),
    "`--resume --vehicle-name red` after `agv1`": resumed_with_another_name,
    "`--vehicle nope.toml`": opened(vehicle="nope.toml"),
    "`--calibration nope.toml`": opened(calibration="nope.toml"),
    "`--plant nope.py:x`": opened(plant="nope.py:x"),
    "`--plant=-1 --dry-run`": opened(plant="-1", dry_run=True),
    "`--workspace oval:3`": opened(workspace="oval:3"),
    "`--out full` (not empty)": opened("full"),
    "`--out` of 300 letters": opened("x" * 300),
    "`--resume` with nothing to resume": opened(None, resume=True),
    "`--resume --out begum` beside `begun`": resumed_elsewhere,
    "`--resume --seed 2` after `--seed 1`": resumed_with_another_seed,
    "`--vehicle` in −1…1, vehicle in µs, over the bus": over_the_bus_in_another_unit,
    "`--vehicle` in −1…1, without `--plant`": opened(vehicle=str(example_path("front_steered"))),
    "`--resume` of runs without `bench.toml`": resumed_without("bench.toml"),
    "`--resume` without `campaign.toml`": resumed_without("campaign.toml"),
    "`agvbench bench nosuch`": lambda: find_benchmark("nosuch"),
    "`agvbench init full` (not empty)": lambda: make_lab("full"),
    "`drive.hold(drive=2.0, …)`": driven(for_s=1.0, drive=2.0),
    '`drive.trajectory("1", condition="blue")`': driven(name="1", condition="blue"),
    "`drive.controlled(…, period_s=2.0)`": controlled("1", PurePursuit, period_s=2.0),
    '`drive.controlled("crab", PurePursuit, …)`': controlled("crab", PurePursuit),
    "`drive.controlled(…)`, a factory that fails": controlled("1", without_gain),
    "`trajectories` without calibration": calibrated_from_nothing,
}


def test_every_row_of_the_page_has_a_case():
    assert set(ROWS) == set(CASES)


@pytest.mark.parametrize("name", CASES)
def test_the_line_is_the_documented_one(name, monkeypatch):
    act = CASES[name]
    with pytest.raises(AgvbenchError) as caught:
        act(monkeypatch) if act is over_the_bus_in_another_unit else act()
    line = str(caught.value)
    expected = re.escape(ROWS[name]).replace("CAUSE", ".+")
    assert re.fullmatch(expected, line), line
    assert caught.value.exit_code == 2
