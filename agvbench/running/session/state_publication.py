"""While a session lasts, its state is on the bus; at its end, how it ended."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from agvbench.bus.link import VehicleLink
from agvbench.running.execution.bench import Bench


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
