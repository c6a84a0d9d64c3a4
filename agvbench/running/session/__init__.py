"""A bench session from its beginning to its end: opened, checked, and used by benchmarks."""
