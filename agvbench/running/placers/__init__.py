"""How a vehicle comes to the start of a run: one file each."""
