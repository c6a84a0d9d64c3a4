"""The log of events from adapters and link: printed once per kind, counted, and kept in the campaign."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from agvbench.bus.messages.event import Event
from agvbench.campaign import CampaignWriter
from agvbench.running.configuration.provenance import recorded_rows
from agvbench.running.links import RunnerLink

EVENTS_TABLE = "events"
_COLUMNS = ("time_s", "run_id", "source", "level", "event", "text", "adapter_s")


class EventLog:
    """Takes events from a link and keeps them in the campaign's table ``events``.

    Parameters
    ----------
    writer
        Of the campaign; what an earlier session kept is continued.
    on_progress
        Progress callback: gets the first event of each kind.
    on_event
        Gets every event.
    """

    def __init__(
        self,
        writer: CampaignWriter,
        on_progress: Callable[[str], None],
        on_event: Callable[[Event], None] = lambda _: None,
    ) -> None:
        self._writer, self._on_progress, self._on_event = writer, on_progress, on_event
        self._rows = recorded_rows(writer.path, EVENTS_TABLE)
        self._saved = self._earlier = len(self._rows)

    def take(self, link: RunnerLink, run_id: str, now_s: float) -> list[Event]:
        """Take what was reported during the run `run_id`, or between runs (``""``), by `now_s` [s] of the campaign."""
        events = link.take_events()
        lock_step = link.identity().lock_step  # an adapter's wall clock would differ from campaign to campaign
        known = {row["event"] for row in self._rows[self._earlier :]}
        for event in events:
            self._on_event(event)
            adapter_s = 0.0 if lock_step else event.t_s
            row = (now_s, run_id, event.role, event.level.name.lower(), event.kind, event.line, adapter_s)
            self._rows.append(dict(zip(_COLUMNS, row, strict=True)))
            if event.kind not in known:
                known.add(event.kind)
                self._on_progress(f"{event.role} reports {event.kind}: {event.line}")
        return events

    def save(self) -> None:
        """Write the table if anything came since it was written.

        Raises
        ------
        RecordingError
            If the disk refuses.
        """
        if len(self._rows) > self._saved:
            self._writer.write_table(EVENTS_TABLE, pd.DataFrame(self._rows, columns=list(_COLUMNS)))
            self._saved = len(self._rows)

    def summary(self) -> list[str]:
        """Return a line for each kind of event of this session, with how often it came."""
        counts: dict[object, int] = {}
        for row in self._rows[self._earlier :]:
            counts[row["event"]] = counts.get(row["event"], 0) + 1
        return [f"{kind}: {count} events, see the campaign's table {EVENTS_TABLE}" for kind, count in counts.items()]
