"""Plants and sensor noise: an independent truth that shares no code with the vehicle model."""
