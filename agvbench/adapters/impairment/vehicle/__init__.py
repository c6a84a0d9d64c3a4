"""Faults of vehicles and of the line to them, a file each."""
