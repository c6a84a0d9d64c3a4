"""From a declared trajectory to timed commands."""
