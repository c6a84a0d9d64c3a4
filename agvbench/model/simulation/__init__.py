"""The simulation of runs: a generated kernel with all effects, and its interface."""
