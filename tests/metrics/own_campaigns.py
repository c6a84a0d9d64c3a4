"""A campaign of one run that drives trajectory 1 as it should."""

from __future__ import annotations

import numpy as np

from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.types import Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

_RATE_HZ = 100.0
_HEADER = CampaignHeader(1, "line", "mule", 0.11, 0.09, Channels.alike("us"), _RATE_HZ)


def line_campaign(path, *, rest_frames=100):
    """Write the campaign into `path`; the vehicle is seen at rest in `rest_frames` frames before it drives."""
    x_m = np.concatenate([np.zeros(rest_frames), np.linspace(0.0, 2.0, 600), np.full(100, 2.0)])
    n = len(x_m)
    start = Pose(-1.0, 0.5, 0.3)
    on_floor = np.array([start.compose(Pose(x, 0.0, 0.0)) for x in x_m])
    t_s = (np.arange(n) - rest_frames + 1) / _RATE_HZ + (0.0 if rest_frames else 0.005)
    unknown = np.full(n, np.nan)
    run = Run(
        run_id="trajectory/1",
        experiment="trajectory",
        trajectory="1",
        condition="calibrated",
        repeat=0,
        target=Pose(2.0, 0.0, 0.0),
        started_s=0.0,
        status="ok",
        firmware="",
        commands=Commands(np.array([0.0, 6.0]), np.array([1900.0, 1500.0]), np.full(2, 1500.0), np.full(2, 1500.0)),
        frames=Frames(t_s, *on_floor.T, np.ones(n, bool), np.arange(n), unknown, unknown),
    )
    writer = CampaignWriter.create(path, _HEADER, durable=False)
    writer.append(run)
    return path
