"""What is driven before a diagnosis."""

EXCITING = ("calibration", "trajectories", "step_response", "free_driving")
"""Benchmarks that excite every effect: the last two tell lags, which steady driving hides."""
