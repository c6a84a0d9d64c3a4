"""AGV adapters: one file each."""
