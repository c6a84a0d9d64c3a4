"""Whether a lab is ready to drive: checks, a file each, and what to do where one fails."""

from agvbench.workflows.doctor.examine import examine
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

__all__ = ["Check", "Finding", "FindingState", "Lab", "examine"]
