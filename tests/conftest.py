"""What all tests share: Hypothesis without deadlines, for machines are shared, and mistakes with their tracebacks."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

# A mistake of agvbench itself is to be seen, not told in one line.
os.environ.setdefault("AGVBENCH_DEBUG", "1")

settings.register_profile(
    "agvbench",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    # A change is judged by its own examples, not by luck; everybody else's runs look for new ones.
    derandomize=bool(os.environ.get("CI")),
)
settings.load_profile("agvbench")
