"""Observers of a session: the link that keeps its exchanges, the endpoint where they join, the published state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from agvbench.bus.bus_config import BusConfig
from agvbench.bus.link import VehicleLink
from agvbench.bus.session import is_open_to_all
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.execution.bench import Bench
from agvbench.running.execution.runner_status import RunnerStatus
from agvbench.running.links import ContinuousLink, RunnerLink
from agvbench.running.observed_link import ObservedLink


def observed_link(settings: BenchSettings, link: VehicleLink, status: RunnerStatus, *, is_observed: bool) -> RunnerLink:
    """Return what the bench drives with: a simulation that is never reset is driven on; `status` sees exchanges."""
    driven = ContinuousLink(link) if settings.place == "auto" and link.identity().lock_step else link
    if not is_observed:
        return driven
    status.link = ObservedLink(driven)
    return status.link


def listening_notice(settings: BenchSettings, listen: str | None) -> list[str]:
    """Return a warning where peers without a certificate can join at the endpoint `listen`."""
    if listen is None:
        return []
    config = BusConfig.load(settings.bus_config) if settings.bus_config else None
    if not is_open_to_all(listen, config, "--listen"):
        return []
    return [f"warning: every peer that reaches {listen} can drive the vehicle; no certificate is required"]


@contextmanager
def published_state(bench: Bench, link: VehicleLink | None) -> Iterator[None]:
    """Publish the state of `bench` over `link` while the context lasts; None: no other process is on its bus."""
    with ExitStack() as stack:
        if link is not None:
            stack.callback(link.publish_state(bench.status.state).close)
        try:
            yield
        except BaseException as error:
            bench.status.finish(_ended_by(error))
            raise
        bench.status.finish(None if bench.failure is None else str(bench.failure))


def _ended_by(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return f"ended by {error}" if str(error) else "ended by Ctrl-C"
    return str(error) or type(error).__name__
