"""The first failure of a session, after which the bench drives no more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from agvbench.errors import LinkError, PlantError, RecordingError

Failure = LinkError | PlantError | RecordingError


class Latch:
    """Remembers what went wrong first.

    A disk that is full now is full for the next run, too: driving on would wear the vehicle for nothing.
    """

    def __init__(self) -> None:
        self._failure: Failure | None = None

    @property
    def failure(self) -> Failure | None:
        """What went wrong first, if anything did."""
        return self._failure

    def check(self) -> None:
        """Raise `LinkError` with the first failure as its cause, if there was one."""
        if self._failure is not None:
            remedy = None if self._failure.remedy else "fix it and go on with --resume"
            raise LinkError("the bench drives no more after the first failure", value=self._failure, remedy=remedy)

    @contextmanager
    def remembering(self) -> Iterator[None]:
        """Remember what fails while the context lasts."""
        try:
            yield
        except (LinkError, PlantError, RecordingError) as error:
            self._failure = self._failure or error
            raise
