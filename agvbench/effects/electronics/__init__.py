"""Effects of the electronics: commands on their way, and the supply."""
