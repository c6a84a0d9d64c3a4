"""Errors of runs, their spread, and comparisons."""
