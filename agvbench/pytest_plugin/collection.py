"""Collection of benchmarks: find them, repeat them, and put them in order.

Blocked order, as in the thesis' fig. 2.1, confounds the condition with battery and warm-up; interleaved order
drives every cell once before any cell twice, so that what drifts falls on all conditions alike.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Generator, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import pytest

from agvbench.errors import AgvbenchError, FlagError, InputError, OneOf
from agvbench.pytest_plugin.options import option, settings_from, worded

if TYPE_CHECKING:
    from agvbench.running.configuration.settings import BenchSettings

REPEAT = "agvbench_repeat"
TRAJECTORIES = "trajectories"
_DEFAULT_REPEATS = 10
_SETTINGS = pytest.StashKey["BenchSettings"]()


def is_bench_file(path: Path) -> bool:
    """Return whether the Python file `path` is a file of benchmarks for agvbench."""
    return path.name.startswith("bench_") and b"agvbench" in path.read_bytes()


class BenchModule(pytest.Module):
    """A ``bench_*.py`` file: its ``bench_*`` functions are benchmarks."""

    def funcnamefilter(self, name: str) -> bool:
        """Collect functions by the prefix that names benchmarks."""
        return name.startswith("bench_")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Report a file of benchmarks that calls `sys.exit` when it is imported: once, though pytest may collect it too."""
    try:
        return (yield)
    except SystemExit as error:
        if not is_bench_file(collector.path):
            raise
        if not isinstance(collector, BenchModule):
            return pytest.CollectReport(collector.nodeid, "passed", None, [])
        remedy = "remove the call, or put it below `if __name__ == '__main__':`"
        line = InputError("calls sys.exit when it is imported", where=collector.path, value=error.code, remedy=remedy)
        return pytest.CollectReport(collector.nodeid, "failed", str(line), [])


@pytest.hookimpl(wrapper=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> Generator[None]:
    """Apply the marks of benchmarks; marks of these names elsewhere are their owners'.

    The trajectory comes first in a run's name, before what pytest's own marks add, and the repeat last.
    """
    is_benchmark = metafunc.definition.getparent(BenchModule) is not None
    if is_benchmark and metafunc.definition.get_closest_marker(TRAJECTORIES):
        from agvbench.planning.trajectories.loading import driven_trajectories

        metafunc.parametrize("trajectory", driven_trajectories(_settings(metafunc.config).trajectories))
    yield
    if is_benchmark:
        _repeat(metafunc)


def _repeat(metafunc: pytest.Metafunc) -> None:
    """Apply the marks ``grid`` and ``repeats``."""
    grids = list(metafunc.definition.iter_markers("grid"))
    mark = metafunc.definition.get_closest_marker("repeats")
    if not grids and mark is None:
        return
    settings = _settings(metafunc.config)
    for grid in grids:
        name, reduced, complete = grid.args
        values = complete if settings.full else reduced
        metafunc.parametrize(name, values, ids=[f"{v:.3g}" if isinstance(v, float) else str(v) for v in values])
    if mark is not None:
        metafunc.fixturenames.append(REPEAT)
        n = _repeats(mark, settings)
        metafunc.parametrize(REPEAT, range(1, n + 1), ids=[f"r{k:02d}" for k in range(1, n + 1)], indirect=True)


def _settings(config: pytest.Config) -> BenchSettings:
    """Return the session's settings, or the usual ones: what is wrong is reported once everything is collected."""
    if _SETTINGS not in config.stash:
        from agvbench.running.configuration.settings import BenchSettings

        try:
            config.stash[_SETTINGS] = settings_from(config)
        except AgvbenchError:
            config.stash[_SETTINGS] = BenchSettings()
    return config.stash[_SETTINGS]


def _repeats(mark: pytest.Mark, settings: BenchSettings) -> int:
    """Return how often to drive: a fixed number, or what ``--repeats`` asks for where the mark leaves it open."""
    fixed = mark.args[0] if mark.args else None
    if fixed is None:
        return settings.repeats or _DEFAULT_REPEATS
    n = mark.kwargs.get("full") or fixed if settings.full else fixed
    if not isinstance(n, int) or n < 1:
        raise pytest.Collector.CollectError(f"repeats: value cannot be used: {n!r} (limit: a whole number, at least 1)")
    return n


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Generator[None]:
    """Order the benchmarks, and leave out conditions that a trajectory does not know.

    The order begins from that of the files: other plugins may choose among benchmarks, and do not shuffle them.
    """
    collected = list(items)
    yield
    kept = set(items)
    benches = [item for item in collected if item in kept and is_bench(item)]
    if benches:
        _arrange(config, items, benches)


def _arrange(config: pytest.Config, items: list[pytest.Item], benches: list[pytest.Item]) -> None:
    try:
        settings = settings_from(config)
        undriven = [item for item in benches if not _condition_applies(item)]
        other_kind = _of_other_kinematics(benches, settings)
        unknown = [] if settings.corrected else [item for item in benches if _is_corrected(item)]
    except AgvbenchError as error:
        raise pytest.UsageError(worded(config, error)) from None

    _check_names(benches)
    if option(config, "--trajectories") and not any(item.get_closest_marker(TRAJECTORIES) for item in benches):
        text = "--trajectories: none of these benchmarks takes it; drive the benchmark trajectories"
        raise pytest.UsageError(worded(config, text))
    if len(unknown) == len(benches):
        text = "--corrected: no corrected model; give the vehicle file that a diagnosis wrote"
        raise pytest.UsageError(worded(config, text))
    left_out = {*undriven, *unknown, *other_kind}
    drivable = [item for item in benches if item not in left_out]
    _require_conditions(config, settings, drivable)
    not_asked = _of_other_conditions(drivable, settings)
    driven = [item for item in drivable if item not in not_asked]
    driven = ordered(driven, settings.order, seed=settings.seed, phase=phase, repeat=repeat, name=run_name)
    items[:] = [item for item in items if not is_bench(item)] + driven
    if deselected := [*undriven, *not_asked]:
        config.hook.pytest_deselected(items=deselected)


def chosen(config: pytest.Config, items: Iterable[pytest.Item]) -> dict[str, Any]:
    """Return what chose the runs of this session, for the one that resumes it: benchmarks, and pytest's ``-k``."""
    from agvbench.running.configuration.benchmark_files import benchmark_name

    given = [str(argument) for argument in config.args]
    if not all(Path(argument.partition("::")[0]).is_file() for argument in given):
        given = list(dict.fromkeys(str(item.path) for item in items if is_bench(item)))
    return {"benchmarks": tuple(map(benchmark_name, given)), "only": config.getoption("keyword")}


def plan_of(items: Iterable[pytest.Item]) -> list[dict[str, object]]:
    """Return the runs of this session as rows of the campaign's table ``planned``."""
    return [_planned(item) for item in items if is_bench(item)]


def _planned(item: pytest.Item) -> dict[str, object]:
    given = parameters(item)
    follows = {"trajectory", "condition"} <= given.keys()
    return {
        "run_id": run_name(item),
        "experiment": experiment(item),
        "trajectory": str(given["trajectory"]) if follows else "",
        "condition": str(given["condition"]) if follows else "",
        "repeat": repeat(item),
    }


def is_bench(item: pytest.Item) -> bool:
    """Return whether a test item is a benchmark."""
    return isinstance(item.getparent(BenchModule), BenchModule)


def parameters(item: pytest.Item) -> dict[str, object]:
    """Return the values that a benchmark is parametrized with, by name."""
    callspec = getattr(item, "callspec", None)
    return dict(callspec.params) if callspec is not None else {}


def repeat(item: pytest.Item) -> int:
    """Return which repeat a benchmark is, from 1."""
    return int(cast(int, parameters(item).get(REPEAT, 1)))


def experiment(item: pytest.Item) -> str:
    """Return what the campaign calls this benchmark's runs."""
    mark = item.get_closest_marker("experiment")
    function = getattr(item, "originalname", None) or item.name
    return str(mark.args[0]) if mark else function.removeprefix("bench_")


def phase(item: pytest.Item) -> int:
    """Return 0 for calibration, which the rest builds upon, and 1 for all else."""
    from agvbench.types import CALIBRATION_EXPERIMENTS  # only here: it loads numpy

    return 0 if experiment(item) in CALIBRATION_EXPERIMENTS else 1


def run_name(item: pytest.Item) -> str:
    """Return the run id of a benchmark: letters, digits, dots and dashes, the same in every session."""
    return re.sub(r"[^A-Za-z0-9.-]+", "-", item.name.removeprefix("bench_")).strip("-")


def _check_names(items: Iterable[pytest.Item]) -> None:
    from agvbench.campaign.completeness import planned_id

    seen: dict[str, str] = {}
    for item in items:
        name = run_name(item)
        if (other := planned_id(name)) != name:
            raise pytest.UsageError(
                f"{item.nodeid}: the run {name!r} would be taken for a further attempt at {other!r}; rename it"
            )
        _check_length(item, name)
        if name in seen:
            raise pytest.UsageError(
                f"two benchmarks would record the run {name!r}: {seen[name]} and {item.nodeid}; rename one"
            )
        seen[name] = item.nodeid


def _check_length(item: pytest.Item, name: str) -> None:
    """Refuse a run whose parts, and those of its further attempts, no file can be named after."""
    from agvbench.campaign.tables.parts import part_name
    from agvbench.errors import CampaignError

    try:
        part_name(f"{name}-attempt99-aborted99")
    except CampaignError as error:
        raise pytest.UsageError(
            f"{item.nodeid}: the run {name[:40]!r}… has too long a name: {len(name)} characters, and "
            f"'-attempt99-aborted99' behind them (limit: {error.limit}); give it a short id"
        ) from None


def _is_corrected(item: pytest.Item) -> bool:
    return parameters(item).get("condition") == "corrected"


def _of_other_conditions(benches: Iterable[pytest.Item], settings: BenchSettings) -> list[pytest.Item]:
    """Return the benchmarks under other conditions than those of ``--conditions``; those without one are driven."""
    asked = settings.asked_conditions
    conditions = {item: parameters(item).get("condition") for item in benches}
    return [item for item, given in conditions.items() if asked and given is not None and given not in asked]


def _require_conditions(config: pytest.Config, settings: BenchSettings, benches: Iterable[pytest.Item]) -> None:
    found = {str(given["condition"]) for item in benches if "condition" in (given := parameters(item))}
    for name in settings.asked_conditions:
        if name not in found:
            remedy = (
                "give a vehicle file with --corrected" if name == "corrected" else "correct it, or choose other runs"
            )
            what, limit = "no run to drive is under this condition", OneOf(sorted(found)) if found else None
            error = FlagError(what, where="--conditions", value=name, limit=limit, remedy=remedy)
            raise pytest.UsageError(worded(config, error))


def _condition_applies(item: pytest.Item) -> bool:
    given = parameters(item)
    if "trajectory" not in given or "condition" not in given:
        return True
    from agvbench.planning import load_trajectory

    conditions = load_trajectory(str(given["trajectory"])).conditions
    return not conditions or given["condition"] in conditions


def _of_other_kinematics(benches: Iterable[pytest.Item], settings: BenchSettings) -> list[pytest.Item]:
    """Return the benchmarks that are marked for vehicles of another kind than the session's."""
    marks = {item: mark.args[0] for item in benches if (mark := item.get_closest_marker("kinematics")) is not None}
    if not marks:
        return []
    from agvbench.running.configuration.vehicles import uncalibrated_vehicle

    kind = uncalibrated_vehicle(settings.vehicle).geometry.kinematics
    return [item for item, asked in marks.items() if asked != kind]


T = TypeVar("T")


def ordered(
    items: Sequence[T],
    order: str,
    *,
    seed: int,
    phase: Callable[[T], int],
    repeat: Callable[[T], int],
    name: Callable[[T], str],
) -> list[T]:
    """Return `items` in the order ``"interleaved"``, ``"blocked"`` or ``"shuffled"``, phase by phase.

    Examples
    --------
    >>> cells = [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    >>> def drive_in(order):
    ...     return ordered(cells, order, seed=1, phase=lambda c: 0, repeat=lambda c: c[1], name=str)
    >>> drive_in("interleaved")
    [('a', 1), ('b', 1), ('a', 2), ('b', 2)]
    >>> drive_in("blocked") == cells
    True
    """
    if order == "interleaved":
        return sorted(items, key=lambda item: (phase(item), repeat(item)))
    if order == "shuffled":
        return sorted(items, key=lambda item: (phase(item), _digest(seed, name(item))))
    return sorted(items, key=phase)


def _digest(seed: int, name: str) -> bytes:
    """Return a place in the shuffle that hangs on the item's own name, not on what else is driven."""
    return hashlib.sha256(f"{seed}:{name}".encode()).digest()
