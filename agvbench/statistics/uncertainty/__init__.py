"""Uncertainty budgets after the GUM."""
