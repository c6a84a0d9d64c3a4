"""Faults, a file for each stage of the loop."""
