"""Comparison of two campaigns: whether they are comparable, their differences, gates, exit codes."""
