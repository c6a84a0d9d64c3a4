"""A discrepancy term for what no effect of the library explains."""
