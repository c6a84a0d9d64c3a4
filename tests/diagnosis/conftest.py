"""Campaigns of a vehicle of a few lines, in memory and on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tiny_vehicle import HEADER, InMemory, Tiny, campaign_runs

from agvbench.campaign import CampaignWriter
from agvbench.types import Run


@pytest.fixture(scope="session")
def tiny_campaign() -> Callable[..., InMemory]:
    """Return a function that drives a campaign with what is true of the vehicle."""
    known: dict[Tiny, InMemory] = {}

    def drive(tiny: Tiny) -> InMemory:
        if tiny not in known:
            known[tiny] = InMemory(campaign_runs(tiny))
        return known[tiny]

    return drive


@pytest.fixture(scope="session")
def write_campaign() -> Callable[[Path, list[Run]], Path]:
    """Return a function that writes runs as a campaign directory."""

    def write(path: Path, runs: list[Run]) -> Path:
        writer = CampaignWriter.create(path, HEADER)
        for run in runs:
            writer.append(run)
        return path

    return write
