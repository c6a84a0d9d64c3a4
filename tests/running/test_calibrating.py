"""A session calibrates from all of its calibration runs or not at all, however often it is interrupted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from agvbench.errors import FitError, LinkError
from agvbench.model import Prior, VehicleModel, thesis_vehicle
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.running.execution.calibration import RUNS_DIGEST, VEHICLE_FILE
from agvbench.running.session.driver import NotDrivenError
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession

SHARES = (-0.8, -0.4, 0.4, 0.8)
RUNS = {f"{axle}{share}": (axle, share) for axle in ("front", "rear", "drive") for share in SHARES}


@contextmanager
def session(path: Path, mocap: str = "sim", runs: Iterable[str] = RUNS, vehicle: str = "") -> Iterator[BenchSession]:
    given = {"vehicle": vehicle, "seed": 3, "mocap": mocap}
    plan = [
        {"run_id": name, "experiment": experiment(name), "trajectory": "", "condition": "", "repeat": 1}
        for name in runs
    ]
    with open_session(given, out=str(path), resume=path.exists(), dry_run=False, plan=plan) as opened:
        opened.expect(list(runs), list(runs))
        yield opened


def experiment(name: str) -> str:
    axle, _ = RUNS[name]
    return "drive" if axle == "drive" else f"steering_{axle}"


def calibrate(opened: BenchSession) -> None:
    """Drive all calibration runs; none is awaited any more, whatever a benchmark asserts of it then."""
    for name, (axle, share) in RUNS.items():
        opened.driver(name, experiment=experiment(name), repeat=1).hold(for_s=3.0, **{"drive": 1.0, axle: share})


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("undisturbed") / "campaign"
    with session(path) as opened:
        calibrate(opened)
        opened.model("calibrated")
    return path


@pytest.mark.parametrize("left_behind", [False, True], ids=["", "with a vehicle.toml of a part"])
def test_after_a_stop_in_mid_calibration_the_resumed_session_calibrates_from_all(
    undisturbed: Path, tmp_path: Path, left_behind: bool
) -> None:
    path = tmp_path / "campaign"
    with session(path, "impaired:frozen@11/1.5:sim") as opened:
        with pytest.raises(LinkError, match="tracking is frozen"):
            calibrate(opened)
        with pytest.raises(LinkError, match="drives no more"):
            opened.plan(opened.trajectory("1"), "calibrated")
    assert not (path / VEHICLE_FILE).exists()
    if left_behind:
        thesis_vehicle().save(path / VEHICLE_FILE)
    missing = "2 calibration runs were not driven, drive0.4 .*drive bench_calibration.py too"
    with session(path, runs=[]) as opened, pytest.raises(FitError, match=missing):
        opened.model("calibrated")
    with session(path) as opened:
        assert "resumed: 10 runs done, 2 to drive" in opened.notices
        with pytest.raises(FitError, match="12 calibration runs were not driven, drive-0"):
            opened.model("calibrated")
        calibrate(opened)
        opened.model("calibrated")
    # The run that was stopped draws other random numbers when it is driven again.
    now, before = (VehicleModel.load(where / VEHICLE_FILE).provenance for where in (path, undisturbed))
    for entry in ("runs_used", RUNS_DIGEST):
        assert now[entry] == before[entry]


def test_the_calibrated_vehicle_keeps_the_priors_of_the_nominal_one(tmp_path: Path) -> None:
    nominal = uncalibrated_vehicle()
    latency = Prior("mocap_latency", "latency_s", 0.008, 0.001, "data sheet")
    replace(nominal, priors=(latency,)).save(tmp_path / "nominal.toml")
    with session(tmp_path / "campaign", vehicle=str(tmp_path / "nominal.toml")) as opened:
        calibrate(opened)
        assert opened.model("calibrated").priors == (latency,)
    assert VehicleModel.load(tmp_path / "campaign" / VEHICLE_FILE).priors == (latency,)


def test_a_calibration_that_runs_were_driven_with_is_kept(undisturbed: Path) -> None:
    with session(undisturbed) as opened:
        calibrated = opened.model("calibrated")
        opened.driver("turn", experiment="trajectory", repeat=1).trajectory("5", condition="calibrated")
        opened.driver("more", experiment="drive", repeat=2).hold(for_s=3.0, drive=0.6)
    with session(undisturbed) as opened:
        assert opened.model("calibrated") == calibrated


def test_without_calibration_runs_the_first_run_that_needs_them_says_so(tmp_path: Path) -> None:
    with session(tmp_path / "campaign", runs=[]) as opened:
        opened.driver("turn", experiment="trajectory", repeat=1).trajectory("5", condition="uncalibrated")
        with pytest.raises(FitError, match="no calibration run counts"):
            opened.plan(opened.trajectory("5"), "calibrated")
        with pytest.raises(NotDrivenError, match="not calibrated, as the first such run says"):
            opened.plan(opened.trajectory("6"), "calibrated")
