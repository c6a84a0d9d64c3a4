"""What a session is asked for: options, settings, vehicle, benchmarks and directory; and their provenance."""
