"""The NatNet protocol: packets, and what they hold in each version of the bit stream."""
