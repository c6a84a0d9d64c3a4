"""What stops a vehicle while it drives: rules that watch frames as they come."""

from agvbench.running.supervision.limits import DEFAULT_SAFETY, SafetyLimits
from agvbench.running.supervision.stop import STOPPED, safety_stop
from agvbench.running.supervision.supervisor import Supervisor

__all__ = ["DEFAULT_SAFETY", "STOPPED", "SafetyLimits", "Supervisor", "safety_stop"]
