"""Effects of the ground: tyres, and the floor under them."""
