"""Recordings of other programs in, and campaigns out."""
