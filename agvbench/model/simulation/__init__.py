"""The generated simulation: effects composed into one compiled loop."""
