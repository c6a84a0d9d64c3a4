"""Tables, figures, HTML and Rerun recordings."""

from agvbench.reporting.write import WrittenReport, write_report

__all__ = ["WrittenReport", "write_report"]
