"""A small campaign, driven by the thesis' vehicle model itself and seen with a little noise."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import agvbench
from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.model import nominal_model, thesis_vehicle
from agvbench.planning import load_trajectory
from agvbench.types import NO_TARGET, Commands, Frames, Run
from agvbench.vehicle.channels import Channels

TRUTH = thesis_vehicle()
HOSTILE = "<script>$alert$</script>"
_BEFORE_S, _AFTER_S, _RATE_HZ = 0.6, 1.2, 60.0


def seen(commands: Commands, rng: np.random.Generator) -> Frames:
    """Return what cameras see of the true vehicle from (1, 2, 0.5) on."""
    t_s = np.arange(-_BEFORE_S, commands.t_s[-1] + _AFTER_S, 1.0 / _RATE_HZ)
    poses = agvbench.simulate(TRUTH, commands, agvbench.Pose(1.0, 2.0, 0.5), t_s)
    x, y, heading = (poses + rng.normal(0.0, 3e-4, poses.shape)).T
    count, unknown = np.arange(len(t_s)), np.full(len(t_s), np.nan)
    return Frames(t_s, x, y, heading, np.ones(len(t_s), np.bool_), count, unknown, unknown)


def held(drive: float, front: float, rear: float) -> Commands:
    """Return a command that is held for six seconds, and the stop."""
    return Commands(np.array([0.0, 6.0]), np.array([drive, 1500.0]), np.array([front, front]), np.array([rear, rear]))


def calibration_runs() -> Iterator[tuple[str, Commands]]:
    """Return the experiment and the commands of each calibration run."""
    for pulse in np.linspace(1100.0, 1900.0, 7):
        yield "steering_front", held(900.0, pulse, 1500.0)
        yield "steering_rear", held(900.0, 1500.0, pulse)
    for pulse in np.linspace(900.0, 2100.0, 13):
        yield "drive", held(pulse, 1500.0, 1500.0)


def runs(trajectory_name: str) -> Iterator[Run]:
    """Return calibration runs, and three repeats of a quarter turn under two conditions."""
    rng = np.random.default_rng(3)
    shared = {"status": "ok", "firmware": "1"}
    for number, (experiment, commands) in enumerate(calibration_runs()):
        frames = seen(commands, rng)
        names = {"run_id": f"c{number}", "experiment": experiment, "trajectory": "", "condition": "uncalibrated"}
        yield Run(
            **names, **shared, repeat=1, target=NO_TARGET, started_s=60.0 * number, commands=commands, frames=frames
        )
    believed = nominal_model("nominal", TRUTH.geometry, Channels.alike("us"))
    for number in range(6):
        condition = ("uncalibrated", "calibrated")[number % 2]
        plan = agvbench.plan(load_trajectory("5"), (believed, TRUTH)[number % 2])
        names = {"run_id": f"t{number}", "experiment": "trajectory", "trajectory": trajectory_name}
        yield Run(
            **names, **shared, condition=condition, repeat=1 + number // 2, target=plan.target,
            started_s=3600.0 + 60.0 * number, commands=plan.commands, frames=seen(plan.commands, rng),
        )  # fmt: skip


@pytest.fixture(scope="session")
def campaign(tmp_path_factory) -> agvbench.Campaign:
    """The campaign, whose trajectory has a name that no page and no figure may take for markup."""
    path = tmp_path_factory.mktemp("api") / "campaign"
    header = CampaignHeader(1, f"monday {HOSTILE}", "thesis", 0.181, 0.121, Channels.alike("us"), _RATE_HZ)
    writer = CampaignWriter.create(path, header, durable=False)
    for run in runs(HOSTILE):
        writer.append(run)
    return agvbench.Campaign.open(path)


@pytest.fixture
def axes() -> Axes:
    """Axes of a figure that belongs to no global state."""
    mpl.use("Agg")
    return Figure().add_subplot()


@pytest.fixture(scope="session")
def hostile() -> str:
    """The trajectory's name."""
    return HOSTILE
