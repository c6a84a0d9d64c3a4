"""The options ``--margin-mm`` and ``--margin-deg``: the noise band of comparisons."""

from __future__ import annotations

import argparse

from agvbench.running.configuration.option_types import number


def add_margin_arguments(parser: argparse.ArgumentParser, in_mm: str, in_deg: str) -> None:
    """Declare the margins of what is in mm and what is in degrees."""
    parser.add_argument("--margin-mm", metavar="MM", type=number, help=f"noise band of {in_mm} (default: 5)")
    parser.add_argument("--margin-deg", metavar="DEG", type=number, help=f"noise band of {in_deg} (default: 1)")


def margins(arguments: argparse.Namespace) -> tuple[float, float]:
    """Return the margins in mm and in degrees, as given or their defaults."""
    from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM

    in_mm, in_deg = arguments.margin_mm, arguments.margin_deg
    return MARGIN_MM if in_mm is None else in_mm, MARGIN_DEG if in_deg is None else in_deg
