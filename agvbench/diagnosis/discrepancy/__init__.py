"""Discrepancy terms: screening by regression, and selection in the simulation."""
