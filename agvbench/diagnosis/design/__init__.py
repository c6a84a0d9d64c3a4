"""The experiment to drive next: designs, criteria, search."""
