"""Trajectories as users declare them: segments, shapes, and the TOML files that hold them."""
