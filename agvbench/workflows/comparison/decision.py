"""What a comparison and a gate amount to: when ``agvbench compare`` fails, its exit code, and its JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agvbench.campaign import Campaign
from agvbench.metrics.gate import GateCheck, GateVerdict, check_gate
from agvbench.metrics.gate_rules import GateRule, read_gate
from agvbench.metrics.table import metric_table
from agvbench.statistics import Comparison, ComparisonVerdict
from agvbench.statistics.comparison_summary import comparison_to_json
from agvbench.workflows.comparison.comparability import NOTHING_KNOWN, Comparability
from agvbench.workflows.output_files import write_file

POLICIES = ("regression", "any", "never")
_FAILING: dict[str, tuple[ComparisonVerdict, ...]] = {
    "regression": (ComparisonVerdict.WORSE,),
    "any": (ComparisonVerdict.WORSE, ComparisonVerdict.BETTER),
    "never": (),
}


@dataclass(frozen=True)
class FailurePolicy:
    """When a comparison fails: by its verdicts (one of `POLICIES`), and by the rules of a gate."""

    verdicts: str
    rules: tuple[GateRule, ...] = ()

    @classmethod
    def parse(cls, fail_on: Sequence[str], gate: Path | None = None) -> FailurePolicy:
        """Return the policy of ``--fail-on`` and ``--gate``: with rules alone, verdicts do not fail.

        Raises
        ------
        FlagError
            If one is neither a policy nor a rule.
        FileError
            If the gate file cannot be used.
        """
        named = [text for text in fail_on if text in POLICIES]
        rules = [GateRule.parse(text) for text in fail_on if text not in POLICIES]
        rules += [] if gate is None else read_gate(gate)
        return cls(named[-1] if named else "never" if rules else "regression", tuple(rules))

    @property
    def failing(self) -> tuple[ComparisonVerdict, ...]:
        """The verdicts that fail."""
        return _FAILING[self.verdicts]

    def checks(self, a: Campaign, b: Campaign | None, conditions: tuple[str, str] | None) -> list[GateCheck]:
        """Return the checks of the rules on `b`, or on the second condition of `a` without it.

        Raises
        ------
        InputError
            If a rule applies to nothing.
        CampaignError
            If a campaign cannot be read.
        """
        if not self.rules:
            return []
        before = metric_table(a)
        return check_gate(self.rules, before if b is None else metric_table(b), before, conditions=conditions)


def exit_code(
    comparison: Comparison,
    policy: FailurePolicy,
    checks: Sequence[GateCheck] = (),
    known: Comparability = NOTHING_KNOWN,
) -> int:
    """Return 0 (nothing failed), 1 (a verdict or a rule failed), 2 (could not compare) or 3 (inconclusive).

    Inconclusive: the campaigns are not comparable; or nothing failed, and one is incomplete, or has too few repeats for
    a rule. Without rules, ``never`` gives 0 wherever a comparison was possible.
    """
    if not comparison.could_compare and not checks:
        return 2
    if policy.verdicts == "never" and not checks:
        return 0
    if known.incomparable:
        return 3
    failing = any(comparison.of(verdict) for verdict in policy.failing)
    if failing or any(check.verdict is GateVerdict.FAIL for check in checks):
        return 1
    if not comparison.could_compare and policy.failing:
        return 2
    open_checks = any(check.verdict is GateVerdict.INCONCLUSIVE for check in checks)
    return 3 if known.incomplete or open_checks else 0


def write_json(
    comparison: Comparison, path: str | Path, known: Comparability = NOTHING_KNOWN, checks: Sequence[GateCheck] = ()
) -> None:
    """Write `comparison` as JSON (schema 1), with what was `known` before it and the checks of a gate.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    content = comparison_to_json(comparison) | {
        "complete": not known.incomplete,
        "cautions": list(known.sentences),
        "calibrations": list(known.calibrations),
        "gate": [_check(check) for check in checks],
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    write_file("--json", Path(path), lambda file: file.write_text(f"{text}\n", encoding="utf-8"))


def _check(check: GateCheck) -> dict[str, Any]:
    numbers = {"before": check.before, "now": check.now, "allowed": check.allowed, "p_value": check.p_value}
    return {
        "rule": check.rule.text,
        "trajectory": check.trajectory,
        "condition": check.condition,
        "repeats": {"a": check.repeats_a, "b": check.repeats_b},
        **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
        "unit": check.rule.metric_unit,
        "beyond": check.is_beyond,
        "verdict": str(check.verdict),
    }
