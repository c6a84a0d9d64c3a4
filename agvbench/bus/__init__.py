"""The Zenoh bus: keys, messages, clocks and links."""
