"""What is published of the effects found: estimates, structure in the maps, residuals, the corrected vehicle."""
