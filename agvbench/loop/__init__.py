"""The loop of bench, diagnosis, correction and bench: its stages, and what it gained."""
