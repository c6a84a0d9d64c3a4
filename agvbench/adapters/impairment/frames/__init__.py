"""Faults of frames, a file each."""
