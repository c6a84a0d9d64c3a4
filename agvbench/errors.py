"""The error tree. Every error that a user can cause is one of these, and prints as one line.

::

    AgvbenchError                 exit code 2: bad input or set-up
    ├── InputError                a file, flag, table or message that cannot be used
    │   ├── FlagError             a command line option
    │   ├── FileError             a file that is missing, unreadable or of the wrong form
    │   └── CampaignError         a campaign whose tables contradict themselves or the schema
    │       └── RecordingError    a campaign that cannot be written: the disk is full, the folder gone
    ├── VehicleError              a vehicle description or static map that cannot be used
    ├── PlanError                 a trajectory that this vehicle cannot drive here
    ├── FitError                  data that do not determine what is fitted
    │   └── NotAnArcError         points that do not lie on an arc
    ├── PlantError                a plant that breaks the plant protocol
    ├── ControllerError           a controller of a closed-loop run that failed, or returned what cannot be commanded
    └── LinkError                 bus, adapters and hardware
        ├── MessageError          a message that cannot be decoded
        ├── AdapterGoneError      an adapter that did not answer or vanished
        ├── PlacingError          a vehicle that was not brought to its start
        └── SafetyStopError       a vehicle that was stopped: lost, frozen, jumping, or about to leave the floor
            └── RunStoppedError   the same, where no person is needed: lost, or about to leave the floor

A message names *what* is wrong, *where*, the *value*, the *limit* with its unit and the *remedy*.
"""

from __future__ import annotations

from collections.abc import Iterable

INTERNAL_ERROR_EXIT_CODE = 70
"""Of an error in agvbench itself, as in ``sysexits.h``: neither bad input (2) nor a failed run (1)."""


def visible(text: str) -> str:
    r"""Return `text` with every character that is not shown, such as a terminal's escape sequences, written out.

    >>> print(visible("slalom\x1b[2J"))
    slalom\x1b[2J
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class OneOf:
    """The names of which a value must be one, as the limit of an error.

    >>> print(InputError("unknown maps", value="'spline'", limit=OneOf(["default", "thesis"])))
    unknown maps: 'spline' (one of: default, thesis)
    """

    def __init__(self, names: Iterable[object]) -> None:
        self._names = tuple(map(str, names))

    def __str__(self) -> str:
        return ", ".join(self._names) or "none"


class AgvbenchError(Exception):
    """Bad input or set-up, reported in one line.

    Parameters
    ----------
    what
        What is wrong, without a full stop: ``"radius is too small"``.
    where
        File, line, table, column, flag or key expression, as the user would write it.
    value
        The offending value, with its unit.
    limit
        The limit it breaks, with its unit; `OneOf` the names that are allowed.
    remedy
        What to do about it, as an imperative.

    Examples
    --------
    >>> print(PlanError("turning radius is too small", where="u_turn.toml: segments[1]",
    ...                 value="0.20 m", limit="at least 0.36 m", remedy="widen the turn"))
    u_turn.toml: segments[1]: turning radius is too small: 0.20 m (limit: at least 0.36 m); widen the turn
    """

    exit_code = 2

    def __init__(
        self,
        what: str,
        *,
        where: object = None,
        value: object = None,
        limit: object = None,
        remedy: str | None = None,
    ) -> None:
        self.what, self.where, self.value, self.limit, self.remedy = what, where, value, limit, remedy
        super().__init__(self._line())

    def _line(self) -> str:
        line = self.what if self.where is None else f"{self.where}: {self.what}"
        if self.value is not None:
            line += f": {self.value}"
        if self.limit is not None:
            line += f" ({'one of' if isinstance(self.limit, OneOf) else 'limit'}: {self.limit})"
        if self.remedy is not None:
            line += f"; {self.remedy}"
        return visible(" ".join(line.split()))


class InputError(AgvbenchError):
    """A file, flag, table or message that cannot be used."""


class FlagError(InputError):
    """A command line option with a value that cannot be used."""


class FileError(InputError):
    """A file that is missing, unreadable or of the wrong form."""


class CampaignError(InputError):
    """A campaign whose tables contradict themselves or the schema."""


class NotComparableError(InputError):
    """Campaigns that no comparison can conclude from: one is incomplete, or the vehicles are of different kinds."""

    exit_code = 3


class RecordingError(CampaignError):
    """A campaign that cannot be written any more: the disk is full, its folder is gone."""


class VehicleError(AgvbenchError):
    """A vehicle description or static map that cannot be used."""


class PlanError(AgvbenchError):
    """A trajectory that this vehicle cannot drive here."""


class UnsuitedVehicleError(PlanError):
    """A trajectory that this vehicle can drive nowhere: it lacks the steered axle or the unit of commands."""


class FitError(AgvbenchError):
    """Data that do not determine what is fitted."""


class NotAnArcError(FitError):
    """Points that do not lie on an arc: too few, not finite, straight, or too short an arc."""


class PlantError(AgvbenchError):
    """A plant that breaks the plant protocol."""


class ControllerError(AgvbenchError):
    """A controller of a closed-loop run that failed, or returned what cannot be commanded."""


class LinkError(AgvbenchError):
    """The bus, an adapter or the hardware behind it."""


class MessageError(LinkError):
    """A message that cannot be decoded: wrong magic, version, kind, length or count."""


class SafetyStopError(LinkError):
    """A vehicle that was stopped while it drove, because something was not as it should be."""


class RunStoppedError(SafetyStopError):
    """A vehicle that was stopped for a reason that ends its run, but not the session: it is placed and drives again."""


class PlacingError(LinkError):
    """A vehicle that was not brought to its start, by itself or by an operator."""


class AdapterGoneError(LinkError):
    """An adapter that did not answer in time or whose liveliness token vanished."""
