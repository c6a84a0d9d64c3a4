"""Foreign recordings: their mapping, their rows, and the campaign made of them."""
