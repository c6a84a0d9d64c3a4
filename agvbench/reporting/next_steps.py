"""What a lab does next, by what a report says: sentences with commands, the most urgent first."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from shlex import quote

from agvbench.reporting.content import plain_sentences
from agvbench.running.configuration.provenance import SIMULATED_TIME
from agvbench.statistics import ComparisonVerdict
from agvbench.statistics.differences import ALL
from agvbench.statistics.uncertainty.end_pose_budgets import key_to_state
from agvbench.types import RUN_OK
from agvbench.workflows.diagnosis_files import mapping, next_in_words
from agvbench.workflows.report import ReportData

_MOST_LEFT_OUT = 0.1
"""Above this share of runs that do not count, the recording is the first thing to look at."""


def diagnose_command(campaign: Path) -> str:
    """Return the command that diagnoses a campaign, for a shell."""
    directory, file = (quote(plain_sentences(str(path))) for path in (campaign, campaign / "diagnosis.json"))
    return f"agvbench diagnose {directory} --json {file}"


def next_steps(data: ReportData) -> list[str]:
    """Return what to do next; at least one sentence."""
    found = [*_recording(data), *_comparison(data), *_diagnosis(data), *_statement(data)]
    return found or ["Nothing is open: drive again after the next change, and compare (agvbench compare)."]


def _recording(data: ReportData) -> Iterator[str]:
    bad = sum(run.status != RUN_OK for run in data.runs)
    if bad > _MOST_LEFT_OUT * len(data.runs):
        yield f"{bad} of {len(data.runs)} runs do not count: find the cause under Run quality before anything else."


def _comparison(data: ReportData) -> Iterator[str]:
    if len(data.end_poses) and not data.comparisons:
        yield "Drive the trajectories under a second condition (agvbench bench drives uncalibrated and calibrated)."
    open_ones = sum(
        d.verdict is ComparisonVerdict.INCONCLUSIVE and d.trajectory != ALL
        for c in data.comparisons
        for d in c.deciding
    )
    if open_ones:
        plan = f"agvbench compare {quote(plain_sentences(str(data.path)))} --plan"
        yield f"{open_ones} comparisons are inconclusive: {plan} computes how many repeats decide them."


def _diagnosis(data: ReportData) -> Iterator[str]:
    if data.diagnosis is None:
        if any(run.status == RUN_OK for run in data.runs):
            yield f"Find the effect that the calibrated model lacks: {diagnose_command(data.path)}."
        return
    verdict = data.diagnosis.content.get("verdict")
    if verdict == "NAMED" and "corrected" not in data.conditions:
        yield "Drive plans that compensate the named effects: agvbench loop, or bench --corrected VEHICLE.toml."
    if verdict == "UNKNOWN":
        yield "Look at what the residual depends on (What the model lacks): an effect of your own may describe it."
    is_open = verdict in {"AMBIGUOUS", "NOT_IDENTIFIABLE", "UNKNOWN"}
    if is_open and mapping(data.diagnosis.content.get("next_experiment")):
        yield plain_sentences(next(next_in_words(data.diagnosis.content)))


def _statement(data: ReportData) -> Iterator[str]:
    is_simulated = data.provenance.get("time") == SIMULATED_TIME
    keys = dict.fromkeys(key for one in data.budgets for c in one.budget.components if (key := key_to_state(c)))
    cameras = [key for key in keys if key.startswith("camera_")]
    if cameras and not is_simulated:
        yield f"State {', '.join(cameras)} in lab.toml ([uncertainty]): no repeat shows these uncertainties."
