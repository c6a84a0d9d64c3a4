"""Effects of the drive: how wheels follow the commanded speeds."""
