"""What stops a vehicle while it drives: rules that watch frames as they come."""

from agvbench.running.supervision.limits import DEFAULT_SAFETY, SafetyLimits
from agvbench.running.supervision.supervisor import Supervisor, safety_stop

__all__ = ["DEFAULT_SAFETY", "SafetyLimits", "Supervisor", "safety_stop"]
