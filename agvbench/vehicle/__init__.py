"""Geometry, kinematics and static maps of a vehicle with a steered front and rear axle."""
