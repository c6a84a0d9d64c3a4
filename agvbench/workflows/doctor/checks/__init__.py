"""The checks, a file each, in the order of their names."""
