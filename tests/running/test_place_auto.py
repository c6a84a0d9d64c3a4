"""A session that needs nobody: driven over the command line, twice the same, and resumed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from agvbench.adapters import open_rig
from agvbench.errors import FlagError
from agvbench.model import nominal_model
from agvbench.planning import Workspace
from agvbench.running.configuration.settings import PLACES
from agvbench.running.links import ContinuousLink
from agvbench.running.positioning.placers import PLACERS, Auto, Rig, choose_placer
from agvbench.running.quality import DEFAULT_LIMITS
from agvbench.running.session.opening import open_session
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

sys.path.insert(0, str(Path(__file__).parent))

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"


def bench(out: Path, *more: str) -> pd.DataFrame:
    command = [sys.executable, "-c", PROGRAM, "bench", "trajectories", "-k", "1-uncalibrated or 5-uncalibrated"]
    command += ["--place=auto", "--repeats=1", "--seed=5", "--no-report", f"--out={out}", *more]
    done = subprocess.run(command, capture_output=True, text=True, cwd=out.parent, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return pd.read_parquet(out / "runs.parquet").set_index("trajectory")


@pytest.mark.slow
def test_a_session_is_driven_without_anybody_and_resumed(tmp_path: Path, give_up: Callable[[Path, str], None]) -> None:
    runs = bench(tmp_path / "first")
    assert runs["status"].tolist() == ["ok", "ok"]
    assert runs.loc["1", "placing_attempts"] == 0
    assert runs.loc["5", "placing_attempts"] >= 1
    assert (runs["placing_position_error_m"] <= 0.004).all()
    # Time goes on while the vehicle drives back.
    first, second = runs.loc["1"], runs.loc["5"]
    between_s = second["started_s"] - first["started_s"] - first["duration_s"]
    assert between_s == pytest.approx(second["placing_duration_s"])

    again = bench(tmp_path / "second")
    pd.testing.assert_frame_equal(again, runs)

    [lost] = (tmp_path / "second" / "runs.parquet").glob("*trajectory-5*")
    give_up(tmp_path / "second", lost.stem)
    resumed = bench(tmp_path / "second", "--resume")
    assert resumed["status"].tolist() == ["ok", "ok"]
    assert resumed.loc["5", "placing_attempts"] == 0


@pytest.mark.parametrize("lost_s", [1.5, 6.0], ids=["in a run", "on the way back"])
def test_a_simulated_vehicle_that_was_lost_is_placed_by_software(tmp_path: Path, lost_s: float) -> None:
    # The fault lasts until the vehicle is reset.
    given = {"vehicle": "", "place": "auto", "mocap": f"impaired:untracked@1/{lost_s}:sim"}
    with open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        runs = [session.driver(name, experiment="free", repeat=1).hold(drive=0.5, for_s=1.0) for name in "ab"]
    assert [run.status for run in runs] == ["ok", "ok"]
    assert [run.run_id for run in runs] == (["a-attempt2", "b"] if lost_s < 3.0 else ["a", "b"])


def test_who_can_place_what() -> None:
    assert tuple(PLACERS) == PLACES
    assert choose_placer("", simulated=True) is PLACERS["teleport"]
    assert choose_placer("", simulated=False) is PLACERS["operator"]
    assert choose_placer("auto", simulated=True) is choose_placer("auto", simulated=False)
    with pytest.raises(FlagError, match=r"--place: a real vehicle cannot be placed so: teleport \(one of: auto, oper"):
        choose_placer("teleport", simulated=False)


class Real(ContinuousLink):
    """A link to a simulated vehicle that passes for a real one."""

    def identity(self) -> Any:
        """Return who drives."""
        return SimpleNamespace(simulated=False, vehicle="agv1", mocap=SimpleNamespace(adapter="sim"))


def test_an_operator_is_asked_where_a_real_vehicle_does_not_come() -> None:
    told: list[str] = []
    model, room = nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us")), Workspace.circle(6.1)
    with open_rig("sim", plant="returning_plants:Dead") as direct:
        link = Real(direct)
        # Nobody puts a real vehicle anywhere by software: it stands where it stands, 8 mm off.
        link.reset(Pose(0.008, 0.0, 0.0), run_key="a")
        placer = Auto(Rig(link, model, room, Supervisor(room, model.neutral), DEFAULT_LIMITS, told.append))
        assert placer.place(Pose(0.0, 0.0, 0.0), "run") is None
    assert len(told) == 1
    assert told[0].startswith("agvbench/v2/lab/agv1: the vehicle does not move: full drive for 2 s; see to its battery")
