"""Effects of the steering: servos and what joins them to the axles' angles."""
