"""Refit everything the thesis measured, and predict its chapter 8 from the rest.

examples:
  agvbench thesis                          every section on the console
  agvbench thesis --section prediction     the 28 rows of tables 8.3-8.10, predicted, beside the null
  agvbench thesis --out tables/            each table as CSV, everything as thesis.md
  agvbench thesis --json thesis.json       the same for programs
  agvbench thesis --section residuals --figures DIR   from each residual to its effect, with pictures

sections: steering, drive, maps, cornering, battery, lever_arm, errata, prediction, sensitivity, turns, residuals

Each refit stands beside the printed figure; where they differ, the errata say why. The prediction uses chapters
6, 7, 8.1 and appendix B only; what the thesis does not state is assumed by a rule fixed beforehand, and the section
'sensitivity' shows what the other answers would change.
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "refit and predict everything the thesis measured, beside its own figures"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--section", action="append", default=[], metavar="NAME", help="only this section; may be given several times"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write the tables as CSV and Markdown")
    parser.add_argument(
        "--figures", type=Path, metavar="DIR", help="draw the residuals, before and after, one SVG per table"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compute, show and write."""
    from agvbench.reporting.console.thesis import print_section, thesis_console, with_progress
    from agvbench.thesis import thesis_sections, write_json, write_tables

    console = thesis_console()
    sections = with_progress(thesis_sections(arguments.section))
    if arguments.json is not None or arguments.out is not None:
        # Files first: a reader that closes the pipe early must not cost them.
        computed = list(sections)
        if arguments.json is not None:
            write_json(computed, arguments.json)
        if arguments.out is not None:
            write_tables(computed, arguments.out)
        sections = iter(computed)
    if arguments.figures is not None:
        from agvbench.reporting.figures.thesis import write_thesis_figures

        write_thesis_figures(arguments.figures)
    for section in sections:
        print_section(section, console)
    return 0
