"""Fits of static maps, one file for each family, and the selection among them."""
