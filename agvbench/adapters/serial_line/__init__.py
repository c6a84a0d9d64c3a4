"""The serial protocol of the vehicle's firmware: lines, what they mean, a conversation. Nothing here reads a port."""
