"""``sequential.json`` in a campaign: the plan, the analyses and the decision of a sequential comparison (schema 1)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from agvbench.errors import FileError
from agvbench.statistics.repeats.group_sequential import Schedule, Spending, critical_values
from agvbench.statistics.repeats.sequential import (
    Analysis,
    Decision,
    Observation,
    SequentialPlan,
    SequentialVerdict,
    decision,
    verdicts,
)
from agvbench.text_files import read_json

FILE = "sequential.json"
_SCHEMA = 1


@dataclass(frozen=True)
class SequentialRecord:
    """What a campaign knows of its sequential comparison with the campaign in the directory `against`.

    ``against_runs`` is a digest of the runs of that campaign that count: it must not change between analyses.
    """

    against: str
    against_runs: str
    plan: SequentialPlan
    analyses: tuple[Analysis, ...] = ()

    @property
    def verdicts(self) -> list[SequentialVerdict]:
        """Return the verdict on every comparison, by all analyses so far."""
        return verdicts(self.analyses, self.plan)

    @property
    def decision(self) -> Decision:
        """Return what the verdicts amount to."""
        return decision(self.verdicts)

    @property
    def repeats(self) -> int:
        """Return how many rounds of repeats the last analysis had; 0 before the first."""
        return self.analyses[-1].repeats if self.analyses else 0

    def with_analysis(self, analysis: Analysis) -> SequentialRecord:
        """Return the record with one more analysis."""
        return replace(self, analyses=(*self.analyses, analysis))

    @classmethod
    def load(cls, directory: Path) -> SequentialRecord | None:
        """Return the record of the campaign in `directory`, None where it has none.

        Raises
        ------
        FileError
            If it cannot be read, or is not what agvbench wrote.
        """
        path = directory / FILE
        try:
            return _from_json(read_json(path))
        except FileNotFoundError:
            return None
        except OSError as error:
            raise FileError("cannot be read", where=path, value=error.strerror) from None
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            remedy = "restore it from a copy"
            raise FileError("not a record of a sequential comparison", where=path, value=error, remedy=remedy) from None

    def save(self, path: Path) -> None:
        """Write the record to `path`; what follows from the analyses is written for other programs."""
        path.write_text(f"{json.dumps(self._to_json(), indent=1, ensure_ascii=False)}\n", encoding="utf-8")

    def _to_json(self) -> dict[str, Any]:
        return {
            "schema": _SCHEMA,
            "against": self.against,
            "against_runs_sha256": self.against_runs,
            "plan": asdict(self.plan),
            "decision": str(self.decision),
            "comparisons": [_shown(verdict) for verdict in self.verdicts],
            "bounds": _bounds(self.analyses, self.plan),
            "analyses": [
                {"repeats": a.repeats, "observations": [_shown(o) for o in a.observations]} for a in self.analyses
            ],
        }


def _shown(item: Observation | SequentialVerdict) -> dict[str, Any]:
    fields = asdict(item)
    named = dict(zip(("trajectory", "condition", "quantity"), fields.pop("key"), strict=True))
    finite = {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in fields.items()}
    return named | finite


def _bounds(analyses: Sequence[Analysis], plan: SequentialPlan) -> dict[str, Any]:
    """Return the critical z of every analysis for the comparison with the most information, and their levels.

    A difference is held against the strictest level of Holm's correction, the same against the level itself, which
    holds where all comparisons are the same.
    """
    schedule: Schedule = tuple(
        (share, 1.0 if a.repeats >= plan.most_repeats else share)
        for a in analyses
        if (share := max((o.information for o in a.observations), default=0.0)) > 0.0
    )
    level = plan.alpha / max(1, len(analyses[-1].observations) if analyses else 1)
    return {
        name: {"level": one, "critical_z": [_finite(z) for z in critical_values(schedule, one, plan.spending)]}
        for name, one in (("difference", level), ("same", plan.alpha_same))
    }


def _finite(z: float) -> float | None:
    return round(float(z), 6) if math.isfinite(z) else None


def _from_json(content: Mapping[str, Any]) -> SequentialRecord:
    if content["schema"] != _SCHEMA:
        raise ValueError(f"schema {content['schema']}")
    plan = content["plan"]
    return SequentialRecord(
        against=str(content["against"]),
        against_runs=str(content["against_runs_sha256"]),
        plan=SequentialPlan(**{**plan, "spending": Spending(plan["spending"])}),
        analyses=tuple(
            Analysis(int(a["repeats"]), tuple(map(_observation, a["observations"]))) for a in content["analyses"]
        ),
    )


def _observation(entry: Mapping[str, Any]) -> Observation:
    fields: dict[str, Any] = {name: math.nan if value is None else value for name, value in entry.items()}
    key = str(fields.pop("trajectory")), str(fields.pop("condition")), str(fields.pop("quantity"))
    return Observation(key, **fields)


_IN_WORDS = {
    Decision.REGRESSION: "a regression",
    Decision.NO_REGRESSION: "no regression",
    Decision.OPEN: "not decided",
}


def stopped_in_words(campaign: Path, record: SequentialRecord) -> str:
    """Return what to know before a campaign that was driven until decided is compared again."""
    count = len(record.analyses)
    return (
        f"{campaign} was driven until decided, for {record.repeats} of at most {record.plan.most_repeats} repeats with "
        f"{count} {'analysis' if count == 1 else 'analyses'} against {record.against}: the p-values here do not allow "
        f"for that and are too small. Its own decision does: {_IN_WORDS[record.decision]}."
    )
