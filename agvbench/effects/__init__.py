"""Physical effects that a vehicle model may have: one file each."""
