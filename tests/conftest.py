"""What all tests share: Hypothesis without deadlines (machines are shared), and where measured recordings lie."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

settings.register_profile("agvbench", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("agvbench")
