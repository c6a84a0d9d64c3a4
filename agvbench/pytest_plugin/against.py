"""The comparison with an earlier campaign: analyses between rounds of repeats, and the gate at the end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from agvbench.errors import AgvbenchError, FlagError
from agvbench.pytest_plugin.collection import is_bench, phase, plan_of, repeat, run_name
from agvbench.pytest_plugin.options import option, settings_from, worded

if TYPE_CHECKING:
    from agvbench.running.session.session import BenchSession
    from agvbench.workflows.comparison.judged_bench import BenchGate, JudgedBench
    from agvbench.workflows.comparison.sequential_bench import SequentialBench
    from agvbench.workflows.comparison.sequential_record import SequentialRecord

AGAINST = pytest.StashKey["Against"]()
"""The comparison of this session; not there without ``--against``."""
_NEED_AGAINST = ("--until", "--margin-mm", "--margin-deg", "--fail-on", "--gate")


class Against:
    """What a session compares: after each round with `sequential`, and at the end with `gate`.

    ``sequential`` is None without ``--until decided``. ``judged`` is what the gate says of the finished campaign; with
    ``--until decided`` it says something only where it was given rules.
    """

    def __init__(self, sequential: SequentialBench | None, gate: BenchGate) -> None:
        self.sequential, self._gate = sequential, gate
        self.judged: JudgedBench | None = None
        self._session: BenchSession | None = None

    def begin(self, session: BenchSession) -> None:
        """Record the plan in the session's campaign."""
        if not session.is_dry:
            self._session = session
            if self.sequential is not None:
                self.sequential.begin(session.write_beside)
                session.notices += self.sequential.notices()

    def analyse(self, repeats: int) -> str | None:
        """Analyse the campaign where that is due after so many rounds; return a line that says what is open."""
        session, sequential = self._session, self.sequential
        if session is None or sequential is None or session.failure is not None or not sequential.is_due(repeats):
            return None
        return sequential.analyse(session.directory, repeats, session.not_applicable)

    def analyse_last(self) -> str | None:
        """Analyse the campaign after the last round, as `analyse` does."""
        return None if self.sequential is None else self.analyse(self.sequential.record.plan.most_repeats)

    def leaves_out(self, run_id: str) -> bool:
        """Whether a run is not needed any more; the session then does not miss it."""
        if self._session is None or self.sequential is None or not self.sequential.is_superfluous(run_id):
            return False
        self._session.not_needed.add(run_id)
        return True

    def judge(self) -> None:
        """Compare the finished campaign."""
        session = self._session
        if session is None or session.failure is not None or (self.sequential is not None and not self._gate.has_rules):
            return
        from agvbench.running.configuration.campaign_directory import shown

        self.judged = self._gate.judge(shown(session.directory))

    @property
    def exit_code(self) -> int:
        """The exit code of the comparison: 0 where nothing failed, 1 for a regression, 3 where it is not decided."""
        if self._session is None or self._session.failure is not None:
            return 0
        return self._gate.exit_code(self.judged, None if self.sequential is None else self.sequential.record)


def prepare(config: pytest.Config, items: Sequence[pytest.Item]) -> Against | None:
    """Return the comparison that the options ask for, after checking what can be checked before a run; None without.

    Raises
    ------
    AgvbenchError
        If options contradict each other, or the earlier campaign is not comparable with what is planned.
    """
    recorded = _recorded(config)
    directory = option(config, "--against") or (recorded.against if recorded else None)
    if directory is None:
        _require_unused(config)
        return None
    from agvbench.workflows.comparison.decision import FailurePolicy
    from agvbench.workflows.comparison.judged_bench import BenchGate
    from agvbench.workflows.comparison.sequential_bench import SequentialBench, SequentialOptions

    rules = [rule.strip() for rule in (option(config, "--fail-on") or "").split(",") if rule.strip()]
    gate_file = option(config, "--gate")
    policy = FailurePolicy.parse(rules, Path(gate_file) if gate_file else None)
    margins = option(config, "--margin-mm"), option(config, "--margin-deg")
    gate, settings = BenchGate(Path(directory), policy, *margins), settings_from(config)
    if recorded is None and option(config, "--until") is None:
        gate.require_comparable(settings)
        return Against(None, gate)
    options = SequentialOptions(directory, *margins)
    return Against(SequentialBench.prepare(options, settings, plan_of(items), recorded), gate)


def _recorded(config: pytest.Config) -> SequentialRecord | None:
    """Return the record of the session to be resumed, None where it began without ``--until``.

    Raises
    ------
    FlagError
        If it has driven runs without ``--until``, which is given now.
    """
    if not option(config, "--resume"):
        return None
    from agvbench.running.configuration.campaign_directory import choose_directory, has_runs
    from agvbench.workflows.comparison.sequential_record import SequentialRecord

    directory = choose_directory(option(config, "--out"), resume=True)
    record = SequentialRecord.load(directory)
    if record is None and option(config, "--until") and has_runs(directory):
        what, remedy = "the session began without it", "leave it out, or start anew without --resume"
        raise FlagError(what, where="--until", value=option(config, "--until"), remedy=remedy)
    return record


def _require_unused(config: pytest.Config) -> None:
    """Raise `FlagError` for an option that means nothing without an earlier campaign."""
    for flag in _NEED_AGAINST:
        if (value := option(config, flag)) is not None:
            remedy = "give --against DIR, the campaign to compare with"
            raise FlagError("nothing to compare with", where=flag, value=value, remedy=remedy)


def take_analysis(item: pytest.Item) -> None:
    """Make the analysis that is due before a benchmark is driven, and print its line."""
    if AGAINST not in item.config.stash or phase(item) == 0:
        return
    try:
        write_analysis(item.config, item.config.stash[AGAINST].analyse(repeat(item) - 1))
    except AgvbenchError as error:
        pytest.exit(worded(item.config, error), returncode=2)


def write_analysis(config: pytest.Config, line: str | None) -> None:
    """Print the line of an analysis, if there is one, in place of the progress line."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if line is not None and reporter is not None:
        if reporter.isatty:
            reporter.rewrite("", erase=True)
        reporter.write_line(line)


def is_left_out(item: pytest.Item) -> bool:
    """Whether the comparison is decided without this benchmark."""
    return AGAINST in item.config.stash and item.config.stash[AGAINST].leaves_out(run_name(item))


def against_texts(config: pytest.Config) -> Iterator[str]:
    """Yield what the comparison came to, for the end of the session's output."""
    if AGAINST not in config.stash:
        return
    from agvbench.reporting.console.bench import judged_text, sequential_text

    against = config.stash[AGAINST]
    if against.sequential is not None and against.sequential.record.analyses:
        yield sequential_text(against.sequential.record, *against.sequential.saved())
    if against.judged is not None:
        yield judged_text(against.judged)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a benchmark that the comparison does not need any more."""
    if is_bench(item) and is_left_out(item):
        sequential = item.config.stash[AGAINST].sequential
        assert sequential is not None  # noqa: S101 - nothing is left out without it
        pytest.skip(sequential.reason)
