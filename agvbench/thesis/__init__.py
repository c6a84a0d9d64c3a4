"""Everything the thesis measured, refitted and predicted, beside its own figures.

Each section is a pure function of the shipped tables; `SECTIONS` maps its name to it, in reading order.
"""

from __future__ import annotations

from agvbench.thesis.run import section_names, thesis_sections, write_json, write_tables

__all__ = ["section_names", "thesis_sections", "write_json", "write_tables"]
