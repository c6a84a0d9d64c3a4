"""What a bench ends with that was given ``--against``: the comparison, the gate, and the exit code of both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.metrics.gate import GateCheck
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.statistics import Comparison
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM, checked_margins
from agvbench.statistics.repeats.sequential import Decision
from agvbench.workflows.comparison.comparability import Comparability, comparability, require_comparable
from agvbench.workflows.comparison.compare import compare
from agvbench.workflows.comparison.decision import FailurePolicy, exit_code
from agvbench.workflows.comparison.sequential_record import SequentialRecord


@dataclass(frozen=True)
class JudgedBench:
    """A finished campaign against an earlier one: comparison, checks of the rules, and what qualifies both."""

    comparison: Comparison
    checks: list[GateCheck]
    known: Comparability


@dataclass(frozen=True)
class BenchGate:
    """The campaign that a bench is compared with, the margins (None: the usual ones), and when the bench fails."""

    against: Path
    policy: FailurePolicy
    margin_mm: float | None = None
    margin_deg: float | None = None

    @property
    def has_rules(self) -> bool:
        """Whether there is more to check than the verdicts."""
        return bool(self.policy.rules)

    def require_comparable(self, settings: BenchSettings) -> None:
        """Check before a run that the comparison will be possible.

        Raises
        ------
        InputError
            If the earlier campaign cannot be read or compared with, or a margin cannot be used.
        """
        checked_margins(*self._margins())
        require_comparable(Campaign.open(self.against), uncalibrated_vehicle(settings.vehicle).channels)

    def judge(self, directory: Path) -> JudgedBench:
        """Compare the campaign in `directory`, and apply the rules.

        Raises
        ------
        InputError
            If there is nothing to compare, or a rule applies to nothing.
        """
        a, b = Campaign.open(self.against), Campaign.open(directory)
        in_mm, in_deg = self._margins()
        comparison = compare(a, b, margin_mm=in_mm, margin_deg=in_deg)
        return JudgedBench(comparison, self.policy.checks(a, b, None), comparability(a, b))

    def _margins(self) -> tuple[float, float]:
        in_mm, in_deg = self.margin_mm, self.margin_deg
        return MARGIN_MM if in_mm is None else in_mm, MARGIN_DEG if in_deg is None else in_deg

    def exit_code(self, judged: JudgedBench | None, record: SequentialRecord | None) -> int:
        """Return 0 (nothing failed), 1 (a verdict or a rule failed), 2 (could not compare) or 3 (not decided).

        The verdicts are those of the sequential comparison in `record`, which allow for its analyses, else those of
        the comparison that was `judged`.
        """
        policy = self.policy if record is None else replace(self.policy, verdicts="never")
        codes = [] if judged is None else [exit_code(judged.comparison, policy, judged.checks, judged.known)]
        if record is not None:
            codes.append(self._sequential_code(record))
        return 1 if 1 in codes else max(codes, default=0)

    def _sequential_code(self, record: SequentialRecord) -> int:
        if any(verdict.verdict in self.policy.failing for verdict in record.verdicts):
            return 1
        return 3 if record.decision is Decision.OPEN and self.policy.failing else 0
