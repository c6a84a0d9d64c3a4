"""What each command does, in a few lines each."""
