"""The pytest plugin: benchmarks are functions ``bench_*`` in files ``bench_*.py`` that drive a vehicle.

::

    @pytest.mark.repeats(10)
    @pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
    def bench_my_turn(drive, condition):
        drive.trajectory("my_turn.toml", condition=condition)

Fixtures: ``drive`` (see `agvbench.running.session.driver.Driver`) and ``bench`` (the session). Marks: ``repeats``,
``grid``, ``kinematics``, ``experiment``. The plugin is found through its entry point and declares options
``--agvbench-…``. Marks, fixtures and hooks are registered when the first file of benchmarks is found: other sessions of
pytest see none of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest

from agvbench.pytest_plugin.options import pytest_addoption

__all__ = ["pytest_addoption", "pytest_collect_file"]


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect ``bench_*.py`` files that speak of agvbench; other tools' files of that name stay theirs."""
    if file_path.suffix != ".py" or not file_path.name.startswith("bench_"):
        return None
    from agvbench.pytest_plugin.collection import BenchModule, is_bench_file

    if not is_bench_file(file_path):
        return None
    from agvbench.pytest_plugin import session_hooks

    if not parent.config.pluginmanager.is_registered(session_hooks):
        parent.config.pluginmanager.register(session_hooks, "agvbench-session")
    pytest.register_assert_rewrite(*_module_names(file_path, parent.config.rootpath))
    return cast(pytest.Collector, BenchModule.from_parent(parent, path=file_path))


def _module_names(path: Path, root: Path) -> set[str]:
    """Return the names under which pytest may import `path`, so that a failing ``assert`` says what it compared."""
    inside = path.relative_to(root) if path.is_relative_to(root) else path.relative_to(path.parent)
    return {path.stem, ".".join(inside.with_suffix("").parts)}
