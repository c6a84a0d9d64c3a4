"""Drive experiments, record them, and go on after an interruption."""
