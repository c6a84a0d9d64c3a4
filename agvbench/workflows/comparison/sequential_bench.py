"""``agvbench bench --until decided``: check the earlier campaign, analyse after each round, say when to stop."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.campaign import Campaign
from agvbench.errors import FlagError, InputError, PlanError
from agvbench.planning import load_trajectory, plan, steered
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.configuration.vehicles import expected_calibration, uncalibrated_vehicle
from agvbench.statistics import pose_errors, valid
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM, checked_margins
from agvbench.statistics.matching import match_cells, same_target
from agvbench.statistics.quantities import END_POSE
from agvbench.statistics.repeats.sequential import Decision, SequentialPlan, analyse, compared_keys
from agvbench.types import Floats
from agvbench.workflows.comparison.comparability import require_comparable
from agvbench.workflows.comparison.sequential_record import FILE, SequentialRecord

if TYPE_CHECKING:
    import pandas as pd

Place = tuple[str, str]
"""A trajectory and a condition."""
UNTIL = ("decided",)
_TARGET = ["target_x_m", "target_y_m", "target_heading_rad"]


@dataclass(frozen=True)
class SequentialOptions:
    """What the command line says of a sequential comparison; None where it says nothing."""

    against: str | None = None
    margin_mm: float | None = None
    margin_deg: float | None = None

    def margins(self) -> dict[str, float]:
        """Return the margins by column.

        Raises
        ------
        FlagError
            If one is not above 0: then nothing is ever shown to be the same.
        """
        in_mm = MARGIN_MM if self.margin_mm is None else self.margin_mm
        in_deg = MARGIN_DEG if self.margin_deg is None else self.margin_deg
        margins = {q: margin for q, margin in checked_margins(in_mm, in_deg).items() if q in END_POSE}
        for quantity, margin in margins.items():
            if margin == 0.0:
                flag = f"--margin-{quantity.unit}"
                raise FlagError("a margin of 0 is never shown to be kept", where=flag, remedy="give one above 0")
        return {q.column: margin for q, margin in margins.items()}


class SequentialBench:
    """Analyses a campaign that is being driven against an earlier one, until every comparison is decided.

    ``planned`` are the rows of the table ``planned``, ``places`` those trajectories and conditions of them that the
    earlier campaign has, too.
    """

    def __init__(
        self, record: SequentialRecord, errors: pd.DataFrame, planned: Sequence[Mapping[str, Any]],
        places: Sequence[Place],
    ) -> None:  # fmt: skip
        self.record, self._errors, self._places = record, errors, places
        self._rows = {str(row["run_id"]): row for row in planned}
        self._decision = record.decision
        self.left_out = [place for place in _places(planned) if place not in places]

    @classmethod
    def prepare(
        cls,
        options: SequentialOptions,
        settings: BenchSettings,
        planned: Sequence[Mapping[str, Any]],
        recorded: SequentialRecord | None = None,
    ) -> SequentialBench:
        """Check everything that can be checked before anything is driven; go on from what was `recorded`.

        Raises
        ------
        NotComparableError
            If the earlier campaign is incomplete, or its vehicle takes commands in other units.
        InputError
            If it cannot be read, nothing that is planned can be compared with it, it has too few repeats, or an option
            contradicts another one or the record.
        """
        if settings.order != "interleaved":
            remedy = "leave --order out, so that every trajectory is driven once before any twice"
            raise FlagError("has no rounds to analyse", where="--order", value=settings.order, remedy=remedy)
        planned = [_with_name(row) for row in planned]
        if recorded is not None:
            _require_same_options(recorded, options)
        directory = options.against or (recorded.against if recorded else "")
        campaign = Campaign.open(Path(directory))
        require_comparable(campaign, uncalibrated_vehicle(settings.vehicle).channels)
        errors = valid(pose_errors(campaign))
        places = _comparable_places(errors, planned, settings, directory)
        record = SequentialRecord(directory, _digest(errors), _plan(options, errors, planned, places))
        _require_repeats(record, places)
        return cls(record if recorded is None else _continued(recorded, record), errors, planned, places)

    def begin(self, write: Callable[[str, Callable[[Path], object]], None]) -> None:
        """Record the plan with `write`, which also gets every analysis."""
        self._write = write
        self._write(FILE, self.record.save)

    def notices(self) -> list[str]:
        """Return what to know before the first run: what is not compared, and a decision that was made before."""
        names = ", ".join(f"{trajectory} {condition}" for trajectory, condition in self.left_out)
        not_compared = [f"not compared, since {self.record.against} has no runs with this target: {names}"]
        return not_compared * bool(names) + [self.reason] * (self._decision is not Decision.OPEN)

    def is_due(self, repeats: int) -> bool:
        """Whether the campaign is to be analysed when `repeats` rounds are complete."""
        return self._decision is Decision.OPEN and self.record.plan.is_due(repeats, self.record.repeats)

    def analyse(self, directory: Path, repeats: int, undrivable: Collection[str]) -> str:
        """Analyse the campaign in `directory`, record that, and return a line that says what is open.

        ``undrivable`` are the ids of planned runs that the vehicle cannot drive here: they are not compared.
        """
        errors = pose_errors(Campaign.open(directory))
        cells, _ = match_cells(self._errors, errors, conditions=None, same_campaign=False, quantities=END_POSE)
        expected = [place for place in self._places if not self._is_undrivable(place, repeats, undrivable)]
        self.record = self.record.with_analysis(analyse(cells, expected, self.record.plan, repeats))
        self._decision = self.record.decision
        self._write(FILE, self.record.save)
        return analysis_in_words(self.record)

    def _is_undrivable(self, place: Place, repeats: int, undrivable: Collection[str]) -> bool:
        ids = {i for i, r in self._rows.items() if _place(r) == place and int(r["repeat"]) <= repeats}
        return ids.issubset(undrivable)

    def is_superfluous(self, run_id: str) -> bool:
        """Whether a planned run need not be driven any more: a repeat of a trajectory, after the decision."""
        row = self._rows[run_id]
        is_later = bool(row["trajectory"]) and int(row["repeat"]) > self.record.repeats
        return is_later and self._decision is not Decision.OPEN

    @property
    def reason(self) -> str:
        """Why a superfluous run is not driven."""
        record = self.record
        return f"decided after {record.repeats} of at most {record.plan.most_repeats} repeats: {self._decision}"

    def saved(self) -> tuple[int, int]:
        """Return how many of the planned runs of trajectories were needed, and how many were not."""
        repeats = [run_id for run_id, row in self._rows.items() if row["trajectory"]]
        superfluous = sum(map(self.is_superfluous, repeats))
        return len(repeats) - superfluous, superfluous


def _with_name(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a planned run with the name of its trajectory, which may be given as a file, and what it was given as."""
    given = str(row["trajectory"])
    return {**row, "given": given, "trajectory": load_trajectory(given).name if given else ""}


def _place(row: Mapping[str, Any]) -> Place:
    return str(row["trajectory"]), str(row["condition"])


def _places(planned: Sequence[Mapping[str, Any]]) -> list[Place]:
    return list(dict.fromkeys(_place(row) for row in planned if row["trajectory"]))


def _comparable_places(
    errors: pd.DataFrame, planned: Sequence[Mapping[str, Any]], settings: BenchSettings, against: str
) -> list[Place]:
    """Return the planned trajectories and conditions that the earlier campaign has with the same target."""
    targets = {
        (str(trajectory), str(condition)): rows[_TARGET].to_numpy(dtype=float)[0]
        for (trajectory, condition), rows in errors.groupby(["trajectory", "condition"], sort=False)
    }
    shared = [place for place in _places(planned) if place in targets]
    given = {str(row["trajectory"]): row["given"] for row in planned}
    ours = {name: _target(given[name], settings) for name in dict.fromkeys(name for name, _ in shared)}
    found = [place for place in shared if (t := ours[place[0]]) is None or same_target(targets[place], t)]
    if not found:
        raise InputError(
            "nothing to compare: no trajectory under the same condition with the same target",
            where=f"--against {against}",
            value=", ".join(f"{name} {condition}" for name, condition in list(targets)[:4]) or "no run that counts",
            remedy="drive the trajectories and conditions of that campaign",
        )
    return found


def _target(name: str, settings: BenchSettings) -> Floats | None:
    """Return the target of a trajectory as this session will drive it; None where it cannot be planned."""
    with suppress(PlanError):  # the session says so, and leaves it out
        model = expected_calibration(settings.vehicle)
        planned = plan(steered(load_trajectory(name), settings.steering, model), model)
        return np.array(planned.target)
    return None


def _plan(
    options: SequentialOptions, errors: pd.DataFrame, planned: Sequence[Mapping[str, Any]], places: Sequence[Place]
) -> SequentialPlan:
    counts = errors.groupby(["trajectory", "condition"]).size()
    most = max(int(row["repeat"]) for row in planned if _place(row) in places)
    return SequentialPlan(min(int(counts[place]) for place in places), most, options.margins())


def _require_repeats(record: SequentialRecord, places: Sequence[Place]) -> None:
    comparisons = len(compared_keys(places))
    if not record.plan.can_differ(comparisons):
        raise InputError(
            f"too few repeats to decide {comparisons} comparisons",
            where=f"--against {record.against}",
            value=f"{record.plan.repeats_a}, against at most {record.plan.most_repeats}",
            remedy="drive that campaign with more repeats, give more --repeats, or compare fewer --trajectories",
        )


def _digest(errors: pd.DataFrame) -> str:
    return hashlib.sha256("\n".join(sorted(errors["run_id"].astype(str))).encode()).hexdigest()


def _require_same_options(recorded: SequentialRecord, options: SequentialOptions) -> None:
    """Check that no option contradicts what the session began with."""
    remedy = "leave the option out, or start anew without --resume"
    if options.against is not None and Path(recorded.against).resolve() != Path(options.against).resolve():
        what = "a resumed session is compared with what it began with"
        raise FlagError(what, where="--against", value=options.against, limit=recorded.against, remedy=remedy)
    for unit, column in (("mm", "position_mm"), ("deg", "delta_heading_deg")):
        given, before = getattr(options, f"margin_{unit}"), recorded.plan.margins[column]
        if given is not None and given != before:
            what = "a resumed session keeps its margin"
            raise FlagError(what, where=f"--margin-{unit}", value=given, limit=before, remedy=remedy)


def _continued(recorded: SequentialRecord, now: SequentialRecord) -> SequentialRecord:
    """Return what was recorded, after checking that the earlier campaign is still the same."""
    if recorded.against_runs != now.against_runs:
        raise InputError(
            "has other runs than when the comparison began",
            where=f"--against {now.against}",
            remedy="restore it, or start anew without --resume",
        )
    return recorded


def analysis_in_words(record: SequentialRecord) -> str:
    """Return the line that is printed after an analysis."""
    found = record.verdicts
    still_open = sum(verdict.is_open for verdict in found)
    line = f"after {record.repeats} of at most {record.plan.most_repeats} repeats: "
    line += f"{still_open} of {len(found)} comparisons open"
    return line if record.decision is Decision.OPEN else f"{line}; decided: {record.decision}"
