"""Figures, one kind per file: numbers in, an SVG element out."""
