"""How a vehicle comes to the start of a run: put there by software or an operator, or driven there by itself."""
