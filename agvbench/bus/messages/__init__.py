"""The messages on the bus, and how each is packed into bytes."""
