"""A file a target."""
