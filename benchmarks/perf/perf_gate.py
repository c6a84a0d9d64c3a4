"""Gates: false failures of pairs of equal campaigns, and what is found of a growth, over all rules and trajectories.

    python benchmarks/perf/perf_gate.py [--pairs 1000] [--json FILE]

Campaigns are drawn: eight trajectories, four metrics with normal, gamma and signed noise, as many repeats as said. The
planned false-alarm rate is 1 % over all checks. Rates have 95 % Clopper–Pearson bounds.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from agvbench.metrics.gate import GateVerdict, check_gate
from agvbench.metrics.gate_rules import GateRule

_SD_MM = 4.0
_ANY = ("position_error.median>+0%", "heading_error.mean>+0%", "cross_track_rms.p95>+0%")
_TENTH = ("position_error.p95>+10%", "heading_error.max>+10%", "cross_track_rms.sd>+10%")
_GROWN = "3"
_NOTHING = "a check failed where nothing has grown"
_END = "end position error + 3 sd of one trajectory found"
# Rules, and cases of them: what is counted, repeats, growth [standard deviations] of one trajectory.
_RULES = {
    "median, mean and p95, any growth": (_ANY, ((_NOTHING, 10, 0.0), (_NOTHING, 30, 0.0), (_END, 10, 3.0))),
    "p95, max and sd, growth by 10 %": (_TENTH, ((_NOTHING, 10, 0.0), (_NOTHING, 30, 0.0), (_END, 10, 3.0))),
    "bias across, any": (
        ("across_error.bias>+0mm",),
        ((_NOTHING, 10, 0.0), ("2 sd to one side found", 10, 2.0), ("2 sd to one side found", 15, 2.0)),
    ),
    "bias across, more than 1 sd": (
        ("across_error.bias>+1sd",),
        (("failed at 1 sd, the limit", 10, 1.0), ("3 sd to one side found", 10, 3.0), ("3 sd found", 15, 3.0)),
    ),
}


def main() -> None:
    """Run the trials and print their rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--resamples", type=int, default=5000)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = [row for name in _RULES for row in _rates(name, arguments.pairs, arguments.resamples)]
    for row in rows:
        low, high = row["bounds"]
        share = row["count"] / row["pairs"]
        print(f"{row['rules']:34} n = {row['repeats']:2}  {row['what']:46} {row['count']:4} of {row['pairs']}", end="")
        print(f"  {share:6.1%}  ({low:.1%} to {high:.1%})")
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


def _rates(name: str, pairs: int, resamples: int) -> list[dict[str, Any]]:
    texts, cases = _RULES[name]
    rules = [GateRule.parse(text) for text in texts]
    rows = []
    for what, repeats, grown in cases:
        found = sum(_found(rules, repeats, grown, seed, resamples) for seed in range(pairs))
        interval = binomtest(found, pairs).proportion_ci(method="exact")
        bounds = [float(interval.low), float(interval.high)]
        rows.append({"rules": name, "what": what, "repeats": repeats, "count": found, "pairs": pairs, "bounds": bounds})
    return rows


def _found(rules: Sequence[GateRule], repeats: int, grown: float, seed: int, resamples: int) -> bool:
    rng = np.random.default_rng([seed, repeats, int(10 * grown)])
    a, b = _campaign(rng, repeats, 0.0), _campaign(rng, repeats, grown)
    failed = [c for c in check_gate(rules, b, a, resamples=resamples, seed=seed) if c.verdict is GateVerdict.FAIL]
    if not grown:
        return bool(failed)
    return any(c.trajectory == _GROWN and c.rule.metric in ("position_error", "across_error") for c in failed)


def _campaign(rng: np.random.Generator, repeats: int, grown: float) -> pd.DataFrame:
    rows = []
    for trajectory in "12345678":
        shift = grown * _SD_MM if trajectory == _GROWN else 0.0
        drawn = {
            ("position_error", "mm"): rng.normal(20.0, _SD_MM, repeats) + shift,
            ("across_error", "mm"): rng.normal(0.0, _SD_MM, repeats) + shift,
            ("heading_error", "deg"): rng.normal(0.0, 1.0, repeats),
            ("cross_track_rms", "mm"): rng.gamma(4.0, 2.0, repeats),
        }
        for (metric, unit), values in drawn.items():
            named = (trajectory, "calibrated", "ok", metric)
            rows += [(f"{trajectory}-{k}", *named, float(value), unit) for k, value in enumerate(values)]
    return pd.DataFrame(rows, columns=["run_id", "trajectory", "condition", "status", "metric", "value", "unit"])


if __name__ == "__main__":
    main()
