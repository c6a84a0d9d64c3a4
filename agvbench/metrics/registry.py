"""Registry of metrics: those that ship, and those of the lab's folder ``metrics``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType

from agvbench.errors import FileError, FlagError, OneOf
from agvbench.metrics import kinds
from agvbench.metrics.metric import Metric
from agvbench.own_modules import OwnModules, shown_file
from agvbench.registry import modules_of

OWN_METRICS = OwnModules("metrics", "agvbench.metrics", "agvbench_own_metrics", "docs/how-to/add-a-metric.md")
"""Metrics of a lab: the files of the folder ``metrics`` in the current folder that import `agvbench.metrics`."""


@cache
def all_metrics() -> Mapping[str, Metric]:
    """Return every metric by its name: those that ship, then own ones.

    Raises
    ------
    FileError
        If a file cannot be imported, or the name of a metric in it is taken.
    """
    try:
        modules = [*modules_of(kinds), *OWN_METRICS.load()]
    except FileError:
        raise
    except Exception as error:
        raise OWN_METRICS.import_error(error, Path(__file__).parent) from error
    found: dict[str, Metric] = {}
    for module in modules:
        for metric in _metrics_in(module):
            if found.setdefault(metric.name, metric) is not metric:
                where = shown_file(str(module.__file__))
                raise FileError("there is a metric of this name", where=where, value=metric.name, remedy="rename it")
    return MappingProxyType(found)


def named_metric(name: str, *, where: str) -> Metric:
    """Return the metric of this name.

    Raises
    ------
    FlagError
        If there is none; `where` is the option that named it.
    FileError
        As from `all_metrics`.
    """
    if name not in all_metrics():
        raise FlagError("unknown metric", where=where, value=name, limit=OneOf(all_metrics()))
    return all_metrics()[name]


def title_of(name: str) -> str:
    """Return what tables print for a metric; its name where `all_metrics` does not know it."""
    return all_metrics()[name].title if name in all_metrics() else name


def in_registry_order(names: Iterable[str]) -> list[str]:
    """Return metrics by name in the order of `all_metrics`, each once; those that it does not know come last."""
    known, given = list(all_metrics()), dict.fromkeys(names)
    return [*(name for name in known if name in given), *(name for name in given if name not in known)]


def _metrics_in(module: ModuleType) -> list[Metric]:
    """Return the metrics that a module defines, in its order; imported ones are another module's."""
    return [m for m in vars(module).values() if isinstance(m, Metric) and m.evaluate.__module__ == module.__name__]
