"""From measured runs to static maps."""
