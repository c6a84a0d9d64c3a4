"""Safety while driving: the supervisor, its limits and its rules."""
