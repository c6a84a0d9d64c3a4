"""What the Rerun viewer shows: entities of runs, the blueprint, and a stream of both while a bench drives."""
