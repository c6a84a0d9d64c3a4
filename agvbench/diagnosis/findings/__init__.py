"""Findings for publication: estimates, structure of the maps, residuals, the corrected vehicle."""
