"""Blind trials: hidden plants are driven and diagnosed, and the answers scored against the truth."""
