"""Other units and reversed time are refused when a campaign is opened; real vehicles never are."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from campaign_samples import MAPPING, recording, write_csv
from motion_samples import WRONG, bench, write

from agvbench.campaign import Campaign, import_recordings
from agvbench.cli import main
from agvbench.errors import CampaignError

MEASURED = Path(os.environ.get("AGVBENCH_MEASURED", Path(__file__).resolve().parents[3] / "shared" / "measured"))
LABS = {  # axle distances, commands, and what else the recordings need
    "cpm": (0.075, "throttle", "steering", ""),
    "eth": (0.15, "throttle", "steering", ""),
    "warthog": (0.4, "cmd_v", "cmd_w", 'driven = { column = "calib_state", equals = "calib" }'),
}
MAPPED = """\
schema = 1
name = "lab"
vehicle = {{ name = "v", front_axle_m = {0}, rear_axle_m = {0}, command_unit = "normalised", neutral = 0.0 }}
mocap = {{ rate_hz = 30.0 }}
runs = {{ longest_s = 20.0 }}

[columns]
time = {{ column = "t_s", unit = "s" }}
x = {{ column = "x_m", unit = "m" }}
y = {{ column = "y_m", unit = "m" }}
heading = {{ column = "heading_rad", unit = "rad" }}
drive = {{ column = "{1}" }}
front = {{ column = "{2}" }}
{3}
"""


def _refused(path: Path) -> str:
    with pytest.raises(CampaignError) as caught:
        Campaign.open(path).check()
    message = str(caught.value)
    assert "\n" not in message
    assert ": run " in message
    return message


@pytest.mark.parametrize("lab", ["dart", *LABS])
def test_measured_recordings_are_read_and_their_conversions_refused(lab: str, tmp_path: Path) -> None:
    files = sorted((MEASURED / lab).glob("*.csv"))
    if not files:
        pytest.skip(f"no recordings in {MEASURED}: set AGVBENCH_MEASURED")
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(MAPPED.format(*LABS.get(lab, LABS["eth"])))
    campaign = import_recordings("dart" if lab == "dart" else mapping, files, tmp_path / "c")
    tables = {"runs": campaign.runs, "commands": campaign.commands, "poses": campaign.poses}
    for name, (change, what) in WRONG.items():
        changed = tables | {"poses": change(campaign.poses)}
        path = tmp_path / name
        path.mkdir()
        (path / "campaign.toml").write_bytes((tmp_path / "c" / "campaign.toml").read_bytes())
        for table, frame in changed.items():
            frame.to_parquet(path / f"{table}.parquet", index=False)
        assert re.search(what, _refused(path))


@pytest.mark.parametrize("speed_mps", [0.05, 0.3])
@pytest.mark.parametrize("wrong", WRONG)
def test_a_bench_in_another_unit_or_in_reversed_time_is_refused(wrong: str, speed_mps: float, tmp_path: Path) -> None:
    tables = bench(speed_mps)
    Campaign.open(write(tmp_path / "sound", tables)).check()
    change, what = WRONG[wrong]
    assert re.search(what, _refused(write(tmp_path / "wrong", tables | {"poses": change(tables["poses"])})))


def _jumping(poses: pd.DataFrame) -> pd.DataFrame:
    wild = np.random.default_rng(0).random(len(poses)) < 0.08
    return poses.assign(x_m=np.where(wild, poses.x_m + 30.0, poses.x_m), heading_rad=poses.heading_rad + wild * 1.5)


def _noisy_headings(poses: pd.DataFrame) -> pd.DataFrame:
    return poses.assign(heading_rad=poses.heading_rad + np.random.default_rng(0).normal(0.0, 1.5, len(poses)))


def _still(poses: pd.DataFrame) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    return poses.assign(x_m=rng.normal(0.0, 1e-3, len(poses)), y_m=0.0, heading_rad=rng.normal(0.0, 0.1, len(poses)))


@pytest.mark.parametrize(
    "tables",
    [
        pytest.param(bench(heading=lambda course: 0.4), id="crab: the heading stays"),
        pytest.param(bench(heading=lambda course: 0.3 * course + 1.2), id="slip: the heading lags behind the path"),
        pytest.param(bench(heading=lambda course: course + 20.0 * np.pi), id="a heading that has turned ten times"),
        pytest.param(bench(heading=lambda course: np.angle(np.exp(1j * course))), id="wrapped headings"),
        pytest.param(bench(lag_s=0.9), id="a vehicle that answers late"),
        pytest.param(bench(6.0), id="twenty times faster than the thesis vehicle"),
        pytest.param(bench() | {"poses": _jumping(bench()["poses"])}, id="a tracker that jumps"),
        pytest.param(bench() | {"poses": _noisy_headings(bench()["poses"])}, id="headings that are mostly noise"),
        pytest.param(bench() | {"poses": _still(bench()["poses"])}, id="a vehicle at rest"),
        pytest.param(bench() | {"poses": bench()["poses"].groupby("run_id").head(20)}, id="too little motion"),
    ],
)
def test_what_real_vehicles_and_trackers_do_is_read(tables: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    Campaign.open(write(tmp_path / "c", tables)).check()


def test_an_inverted_drive_is_no_reversed_time(tmp_path: Path) -> None:
    """Without a target, a vehicle that drives backward when told to drive forward may be wired so."""
    tables = bench()
    tables["runs"] = tables["runs"].assign(target_x_m=np.nan, target_y_m=np.nan, target_heading_rad=np.nan)
    tables["commands"] = tables["commands"].assign(drive=3000.0 - tables["commands"]["drive"])
    Campaign.open(write(tmp_path / "c", tables)).check()


def test_a_rejected_run_is_not_judged(tmp_path: Path) -> None:
    tables = bench()
    one = tables["poses"]["run_id"] == "r0"
    wild = tables["poses"].assign(x_m=np.where(one, 1e3, 1.0) * tables["poses"]["x_m"])
    Campaign.open(write(tmp_path / "one", tables | {"poses": wild})).check()
    some = tables["poses"]["run_id"].isin(["r0", "r1", "r2"])
    tables["poses"] = tables["poses"].assign(x_m=np.where(some, 1e3, 1.0) * tables["poses"]["x_m"])
    assert "run r0: x_m and y_m are not in metres" in _refused(write(tmp_path / "three", tables))
    tables["runs"].loc[:2, "status"] = "rejected: bumped"
    Campaign.open(write(tmp_path / "rejected", tables)).check()


@pytest.mark.parametrize("command", ["report", "calibrate", "diagnose", "compare"])
def test_every_command_refuses_in_one_line(command, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    tables = bench()
    write(Path("cm"), tables | {"poses": WRONG["centimetres"][0](tables["poses"])})
    write(Path("sound"), tables)
    assert main([command, "cm", *(["sound"] if command == "compare" else [])]) == 2
    printed = capsys.readouterr()
    assert printed.err == (
        f"agvbench {command}: cm/poses.parquet: run r0: x_m and y_m are not in metres: vehicle drives at 30 m/s, as "
        "in 8 of 8 runs judged (limit: 20 m/s, for a wheelbase of 0.2 m); convert them to metres\n"
    )


def test_an_import_in_another_unit_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_csv(Path("r.csv"), recording(200) | {"X": [0.0] * 200, "Z": [-0.5 * row for row in range(200)]})
    Path("mapping.toml").write_text(MAPPING.replace('unit = "mm"', 'unit = "m"'))
    with pytest.raises(CampaignError, match=r"mapping.toml: run r-001: x_m and y_m are not in metres: .* 50 m/s"):
        import_recordings("mapping.toml", ["r.csv"], "c")
    assert not Path("c").exists()
