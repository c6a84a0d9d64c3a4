"""Maps, kinematics and effects composed into a vehicle model."""
