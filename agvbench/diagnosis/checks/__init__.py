"""Whether a campaign suffices for a diagnosis, and whether its tables are consistent."""
