"""The vehicle as it is fitted: nodal maps, batches of runs, predicted poses with derivatives."""
