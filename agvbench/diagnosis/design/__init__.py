"""Design of the next experiment: designs, criteria, search."""
