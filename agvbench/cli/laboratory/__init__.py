"""Set up and check the laboratory."""
