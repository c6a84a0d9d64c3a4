"""A comparison and its gate for other programs and people: a table, JUnit XML, and a Markdown summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from agvbench.metrics.gate import GateCheck, GateVerdict
from agvbench.metrics.registry import all_metrics
from agvbench.reporting.content import Block, Bullets, Column, Content, Paragraph, Table, Value, plain
from agvbench.reporting.pages import to_markdown
from agvbench.reporting.sections.conditions import comparison_table
from agvbench.statistics import Comparison, ComparisonVerdict, Difference
from agvbench.statistics.comparison_summary import describe, headline
from agvbench.workflows.comparison.comparability import Comparability
from agvbench.workflows.output_files import write_file


def gate_table(checks: Sequence[GateCheck]) -> Table:
    """Return the checks of a gate as a table, failures first."""
    columns = [
        Column("rule", "rule"),
        Column("trajectory", "trajectory"),
        Column("condition", "condition"),
        Column("repeats", "n"),
        Column("before", "before", 2),
        Column("now", "now", 2),
        Column("allowed", "allowed", 2),
        Column("unit", "unit"),
        Column("p_value", "p (Holm)", 4, least=1e-4),
        Column("verdict", "verdict"),
    ]
    note = (
        "A rule on growth fails where the statistic is beyond what is allowed and the growth is shown by a "
        "one-sided test at 1 %, corrected for all rows; bias has two sides. Beyond by chance: repeats that scatter so "
        "do not show that the limit is exceeded; a rule that shall find such a growth has a lower limit. Inconclusive: "
        "so few repeats cannot show any growth."
    )
    return Table("gate", f"Gate: {gate_sentence(checks)}", columns, [_row(check) for check in checks], note=note)


def gate_sentence(checks: Sequence[GateCheck]) -> str:
    """Return how many checks failed, are inconclusive, and passed.

    >>> gate_sentence([])
    'no rules'
    """
    if not checks:
        return "no rules"
    counts = {verdict: sum(check.verdict is verdict for check in checks) for verdict in GateVerdict}
    failed, unclear, passed = counts.values()
    return f"{failed} of {len(checks)} checks failed, {unclear} inconclusive, {passed} passed"


def _verdict(check: GateCheck) -> str:
    """Return the verdict in words: what is beyond its limit and passes must not look like what is within."""
    return f"{check.verdict}{', beyond by chance' if check.verdict is GateVerdict.PASS and check.is_beyond else ''}"


def _row(check: GateCheck) -> list[Value]:
    repeats = f"{check.repeats_a}, {check.repeats_b}" if check.repeats_a else str(check.repeats_b)
    names = check.rule.text, check.trajectory, check.condition, repeats
    return [*names, check.before, check.now, check.allowed, check.rule.metric_unit, check.p_value, _verdict(check)]


def write_junit(path: Path, comparison: Comparison, checks: Sequence[GateCheck], *, failing: bool) -> None:
    """Write a comparison and its gate as JUnit XML: a test case for each deciding difference and each check.

    Medians and statistics are properties of the cases. With `failing` a difference with the verdict worse is a failure;
    what is inconclusive is skipped.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    suites = ET.Element("testsuites", name="agvbench compare")
    compared = ET.SubElement(suites, "testsuite", name="comparison")
    for difference in comparison.deciding:
        _difference_case(compared, difference, comparison, failing=failing)
    if checks:
        gate = ET.SubElement(suites, "testsuite", name="gate")
        for check in checks:
            _check_case(gate, check)
    for suite in suites:
        suite.set("tests", str(len(suite)))
        suite.set("failures", str(len(suite.findall("testcase/failure"))))
        suite.set("skipped", str(len(suite.findall("testcase/skipped"))))
    ET.indent(suites)
    text = ET.tostring(suites, encoding="unicode", xml_declaration=True)
    write_file("--junit", path, lambda file: file.write_text(f"{text}\n", encoding="utf-8"))


def _difference_case(suite: ET.Element, d: Difference, comparison: Comparison, *, failing: bool) -> None:
    case = _case(suite, f"{d.trajectory}.{d.condition}", d.quantity.name)
    medians = {"repeats_a": d.a.repeats, "repeats_b": d.b.repeats, "median_a": d.a.median, "median_b": d.b.median}
    _properties(case, {**medians, "difference": d.interval.estimate, "margin": d.margin}, d.quantity.unit)
    if d.verdict is ComparisonVerdict.WORSE and failing:
        ET.SubElement(case, "failure", message=plain(describe(d, comparison)), type="regression")
    elif d.verdict is ComparisonVerdict.INCONCLUSIVE:
        ET.SubElement(case, "skipped", message=plain(describe(d, comparison)))


def _check_case(suite: ET.Element, check: GateCheck) -> None:
    case = _case(suite, f"{check.trajectory}.{check.condition}", check.rule.text)
    counts = {"repeats_a": check.repeats_a, "repeats_b": check.repeats_b}
    unit, digits = check.rule.metric_unit, all_metrics()[check.rule.metric].digits
    _properties(case, {**counts, "before": check.before, "now": check.now, "allowed": check.allowed}, unit)
    if check.verdict is GateVerdict.FAIL:
        message = f"{check.now:.{digits}f} {unit}, allowed {check.allowed:.{digits}f} {unit}"
        ET.SubElement(case, "failure", message=message, type="gate")
    elif check.verdict is GateVerdict.INCONCLUSIVE:
        ET.SubElement(case, "skipped", message="too few repeats to show any growth")
    ET.SubElement(case, "system-out").text = _verdict(check)


def _case(suite: ET.Element, place: str, name: str) -> ET.Element:
    return ET.SubElement(suite, "testcase", classname=plain(place), name=plain(name), time="0")


def _properties(case: ET.Element, values: dict[str, float], unit: str) -> None:
    inside = ET.SubElement(case, "properties")
    for name, value in values.items():
        if math.isfinite(value):
            ET.SubElement(inside, "property", name=name, value=f"{value:.6g}")
    ET.SubElement(inside, "property", name="unit", value=unit)


def write_markdown(
    path: Path, comparison: Comparison, checks: Sequence[GateCheck], known: Comparability, *, failing: bool = True
) -> None:
    """Write a comparison and its gate as Markdown, for a pull request or the summary of a job.

    Without `failing`, verdicts of the comparison do not decide: the gate comes first.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    said = headline(comparison) if failing or not checks else f"Gate: {gate_sentence(checks)}"
    section = Content("comparison", said, tuple(_blocks(comparison, checks, known, failing=failing)))
    title = f"{plain(comparison.name_b)} against {plain(comparison.name_a)}"
    text = to_markdown(title, [section])
    write_file("--markdown", path, lambda file: file.write_text(f"{text}\n", encoding="utf-8"))


def _blocks(
    comparison: Comparison, checks: Sequence[GateCheck], known: Comparability, *, failing: bool
) -> Iterator[Block]:
    if known.sentences:
        yield Bullets(known.sentences)
    if checks:
        yield gate_table(checks)
        if not failing:
            yield Paragraph(f"The rules decide. The verdicts below do not: {headline(comparison)}")
    yield comparison_table(comparison, "comparison")
    yield from (Paragraph(remark) for remark in comparison.remarks)
