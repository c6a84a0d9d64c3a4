"""Campaign directories: read, check, append, import."""
